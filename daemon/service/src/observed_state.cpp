#include "observed_state.hpp"

#include <string>
#include <utility>

#include "model_status_name.hpp"

namespace abbe::daemon {
namespace {

/// The latest request to stop the machine; nullopt until its outcome is known.
std::optional<ObservedStop> observed_stop(const drivers::IppStop& stop) {
  using enum drivers::IppStopOutcome;
  if (stop.outcome == None || stop.outcome == Pending) return std::nullopt;
  return ObservedStop{.number = stop.number,
                      .outcome = name_of(stop.outcome),
                      .text = stop.text,
                      .confirmed = stop.outcome == Stopped};
}

}  // namespace

Observed observed_state(Hub& hub) {
  auto seen = hub.call(
      [&hub] {
        const ActiveModelState active = hub.model_state();
        return Observed{.streams = hub.health(),
                        .session = hub.parts().calibration.status(),
                        .model = {.state = std::string{status_name(active.status)},
                                  .id = active.model != nullptr ? active.model->id : "",
                                  .reason = active.reason},
                        .stop = observed_stop(hub.parts().devices.machine_stop())};
      },
      Hub::kHangsAfter);
  return seen ? std::move(*seen) : Observed{.hub_answers = false};
}

}  // namespace abbe::daemon
