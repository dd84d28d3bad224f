"""A body with joints, fitted to what one camera saw of a person over a clip."""
