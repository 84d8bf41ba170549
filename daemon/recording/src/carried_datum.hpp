#pragma once
/// Selects the attachments that a further file begins with, so that it can be replayed without the
/// earlier files.

#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/counting_state.hpp"
#include "abbe/pipeline/datum.hpp"

namespace abbe::daemon::recording {

struct TimedAttachment {
  RecordingAttachment attachment;
  std::uint64_t time_ns = 0;
};

/// Whether the next file needs the attachment. Call it for the attachments of a file from the
/// newest to the oldest. `settled`: mask of the axes whose earlier datums are not valid any more;
/// updated by the call.
inline bool is_carried_on(const RecordingAttachment& attachment, const DatumState& state,
                          std::uint32_t& settled) {
  if (attachment.name == kReferenceRequestName || attachment.name == kDatumStateName ||
      attachment.name == kCountingStateName)
    return false;
  if (attachment.name != kDatumName) return true;
  const auto datum = datum_from_attachment(attachment);
  if (!datum || datum->from >= state.at) return true;
  const std::uint32_t axis = 1u << datum->axis;
  const bool valid = (settled & axis) == 0;
  settled |= axis;
  return valid;
}

/// Keeps the valid datum of every axis and the datums found since `state`, and adds `state`, which
/// lists the axes that are not referenced.
inline void carry_datum_on(std::vector<TimedAttachment>& attachments, const DatumState& state,
                           std::uint64_t state_time_ns) {
  std::uint32_t settled = state.unknown;
  std::vector<TimedAttachment> carried;
  for (auto kept = attachments.rbegin(); kept != attachments.rend(); ++kept)
    if (is_carried_on(kept->attachment, state, settled)) carried.push_back(std::move(*kept));
  carried.push_back({to_attachment(state), state_time_ns});
  attachments.assign(std::make_move_iterator(carried.rbegin()),
                     std::make_move_iterator(carried.rend()));
}

}  // namespace abbe::daemon::recording
