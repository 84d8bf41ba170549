#pragma once
/// Checks the list of parameters with which a participant announces itself, a writer or a reader.
/// Announcements arrive before any key is checked. Pure.

#include "submessage.hpp"

namespace abbe::dds {

/// The result of the check of an announcement.
enum class Announcement {
  /// the announcement passes; parameters that must not be read are blanked, and the lease is
  /// limited
  Passes,
  /// the announcement is too long, has a value of a wrong length, or belongs to another participant
  Malformed,
  DropMessage,  ///< the list does not conform to the standard: the message must be dropped
};

/// Blanks parameters, and limits the lease, in place.
[[nodiscard]] Announcement check_announcement(const rtps_message::Submessage& data);

}  // namespace abbe::dds
