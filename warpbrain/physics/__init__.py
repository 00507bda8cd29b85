"""What can act on tissue: material laws and mechanisms, one file each."""
