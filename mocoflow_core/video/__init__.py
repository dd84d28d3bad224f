"""A bare video of one person: which frames, which camera, which person, where in each frame."""
