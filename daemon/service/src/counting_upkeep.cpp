#include "counting_upkeep.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdio>
#include <utility>

#include "abbe/config/capabilities.hpp"

namespace abbe::daemon {

void CountingUpkeep::read(const Config& config, std::vector<std::string>& warnings) {
  left_ = left_counting(config, boot_);
  if (!left_.warning.empty()) warnings.push_back(left_.warning);
}

void CountingUpkeep::start(const Config& config, Hub& hub) {
  if (!counted_axes(config)) return;
  thread_.emplace(
      counting_state_file(config.daemon.data_dir),
      [this, set_up = counting_set_up(config), &hub] { return look(set_up, hub); },
      [](const std::string& fault) { fmt::print(stderr, "abbed: {}\n", fault); });
}

void CountingUpkeep::hub_ended() noexcept {
  hub_has_ended_.store(true, std::memory_order_release);  // pairs with the acquire in look()
}

/// The state of the counters for a later run. nullopt if the card has no serial number that
/// identifies it. Called on the thread that writes the file.
std::optional<CountingState> CountingUpkeep::look(const std::string& set_up, Hub& hub) {
  if (boot_.empty()) return std::nullopt;
  const auto counted = [&hub] {
    const ReferenceService& reference = *hub.parts().reference;
    return std::pair{reference.counting(), reference.carried_on()};
  };

  // acquire: pairs with the release in hub_ended(); after it only this thread uses the service
  auto seen = hub_has_ended_.load(std::memory_order_acquire) ? std::optional{counted()}
                                                             : hub.call(counted, Hub::kHangsAfter);
  if (!seen || !seen->first || seen->first->progress.serial_number().empty()) return std::nullopt;

  if (left_.state) {
    left_.state.reset();
    if (!seen->second.empty())
      fmt::print(stderr, "abbed: the counter card counted on: {} stay referenced\n",
                 fmt::join(seen->second, ", "));
  }

  return CountingState{.boot_id = boot_, .set_up = set_up, .counting = std::move(*seen->first)};
}

}  // namespace abbe::daemon
