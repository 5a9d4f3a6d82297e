"""Results of studies in the pages: written, compared and computed again."""
