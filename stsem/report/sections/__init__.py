"""What a report says, part by part; each module turns a part of the document into sections."""
