"""A posed, clothed, textured person with exact truth: the embedded scenes and the tests' oracle."""
