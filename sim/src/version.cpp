namespace abbe::sim {
// Replaced by the room's first real source.
}
