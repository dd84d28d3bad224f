"""Body meshes: sequences, their location, their silhouettes, their surface."""
