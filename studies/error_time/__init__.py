"""Error against run time, beside other codes: half an hour a scene, undisturbed."""
