#pragma once
/// The list of parameters with which a participant announces itself, a writer or a reader. Comes
/// before any key is checked. Pure.

#include "submessage.hpp"

namespace abbe::dds {

/// What becomes of an announcement.
enum class Announcement {
  Passes,       ///< without the parameters that must not be read, and with a limited lease
  Malformed,    ///< too long, a value of a wrong length, or of another participant
  DropMessage,  ///< the list does not conform to the standard: the message must be dropped
};

/// Blanks parameters, and limits the lease, in place.
[[nodiscard]] Announcement check_announcement(const rtps_message::Submessage& data);

}  // namespace abbe::dds
