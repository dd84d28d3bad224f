"""Scenes on disk and clips in memory: frames, masks, background, cameras."""
