namespace abbe::drivers {
// Replaced by the room's first real source.
}
