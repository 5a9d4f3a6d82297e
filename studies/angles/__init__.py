"""Load error of the bias extension with fibres at angles other than 45°."""
