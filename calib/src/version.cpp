namespace abbe::calib {
// Replaced by the room's first real source.
}
