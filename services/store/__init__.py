"""The store of a site: named programs with all their versions, and programs that ran without being saved."""
