"""What is learned: canonical fields and motion fields, and the encodings in front of them."""
