"""Load error on meshes of users, as they are and fitted to the singular fibres."""
