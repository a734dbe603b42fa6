"""What a diagnosis makes of logs whose pose was filtered before it was written."""
