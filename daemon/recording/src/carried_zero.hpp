#pragma once
/// Selects the attachments that a further file begins with, so that it can be replayed without the
/// earlier files.

#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/counting_state.hpp"

namespace abbe::daemon::recording {

struct TimedAttachment {
  RecordingAttachment attachment;
  std::uint64_t time_ns = 0;
};

/// True if the next file needs the attachment. Call it for the attachments of a file from the
/// newest to the oldest. `settled`: mask of the axes whose earlier zeros are no longer valid;
/// updated by the call.
inline bool is_carried_on(const RecordingAttachment& attachment, const ZeroState& state,
                          std::uint32_t& settled) {
  if (attachment.name == kReferenceRequestName || attachment.name == kZeroStateName ||
      attachment.name == kCountingStateName)
    return false;
  if (attachment.name != kZeroName) return true;
  const auto zero = zero_from_attachment(attachment);
  if (!zero || zero->from >= state.at) return true;
  const std::uint32_t axis = 1u << zero->axis;
  const bool valid = (settled & axis) == 0;
  settled |= axis;
  return valid;
}

/// Keeps the valid zero of every axis and the zeros found since `state`, and adds `state`, which
/// lists the axes that are not referenced.
inline void carry_zeros_on(std::vector<TimedAttachment>& attachments, const ZeroState& state,
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
