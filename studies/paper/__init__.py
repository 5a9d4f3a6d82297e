"""The strips and the two elements of Hamila & Boisse (2013), beside what they print."""
