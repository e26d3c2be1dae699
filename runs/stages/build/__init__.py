"""What a stage computes with, made from the scene: the tire, its air, the turning, the contact, the steps."""
