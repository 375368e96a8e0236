"""The page's HTTP routes: files, pictures, video, shapes, recordings. Not accounts and Define."""
