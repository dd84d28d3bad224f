"""A person in a picture: box, keypoints, mask; small interfaces, embedded models, files."""
