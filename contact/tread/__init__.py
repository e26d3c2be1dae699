"""The tread's compliance and its bristles."""
