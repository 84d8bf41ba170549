#include "abbe/service/verification_service.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"

namespace abbe::daemon {

Result<std::uint64_t> VerificationService::begin() {
  ABBE_TRY(check_verification(config_));
  destroy_in_background(std::exchange(points_, StandstillPoints{standstill_options(config_)}));
  running_ = true;
  return ++number_;
}

Result<void> VerificationService::end(std::uint64_t number) {
  ABBE_TRY(points(number));
  if (running_) points_.finish();
  running_ = false;
  return {};
}

Result<const StandstillPoints*> VerificationService::points(std::uint64_t number) const {
  if (number == 0 || number != number_)
    return fail(ErrorCode::Refused, "verify: superseded by another verification");
  return &points_;
}

void VerificationService::cycle(std::span<const protocol::Snapshot> snapshots) {
  for (const auto& snapshot : snapshots) {
    if (!running_) return;
    points_.take(snapshot);
    running_ = points_.points().size() < kMostPoints;
  }
}

std::string VerificationService::stopped() const {
  if (points_.points().size() < kMostPoints) return {};
  return fmt::format(
      "verify: the limit of {} standstills is reached: later ones are not taken; begin another one",
      kMostPoints);
}

}  // namespace abbe::daemon
