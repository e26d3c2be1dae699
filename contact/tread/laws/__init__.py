"""The tread laws, one file each: `contact.tread` of a scene selects one (contact.tread.law)."""
