"""Tools as CAD systems export them: results of the clean tool, or one true line."""
