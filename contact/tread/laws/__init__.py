"""The tread laws, one a file: `contact.tread` of a scene picks one (contact.tread.law)."""
