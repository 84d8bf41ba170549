#include "abbe/service/identity_watch.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/service/background_tasks.hpp"

namespace abbe::daemon {
namespace {

using Known = IdentityWatch::Known;

Known known_from(const MachineIdentity& identity, const ComputerMarks& here) {
  return {.machine_id = identity.machine_id,
          .doubt = why_not_confirmed(identity, here),
          .fault = {},
          .renewed = identity.renewed()};
}

/// A damaged file may hide that a person has not decided yet. A file that could not be written at
/// the first start hides nothing.
Known unknown(const Error& error) {
  return {.machine_id = {},
          .doubt = error.code == ErrorCode::BadInput ? error.text : std::string{},
          .fault = error.text,
          .renewed = {}};
}

Known read_known(const std::filesystem::path& data_dir, const ComputerMarks& here,
                 const Known& before) {
  const auto identity = read_identity(data_dir);
  if (!identity) return unknown(identity.error());
  return *identity ? known_from(**identity, here) : before;
}

}  // namespace

IdentityWatch IdentityWatch::open(const std::filesystem::path& data_dir, const ComputerMarks& here,
                                  protocol::UtcTime now) {
  IdentityWatch watch(data_dir, here);
  const auto identity = open_identity(data_dir, here, now);
  watch.known_ = identity ? known_from(*identity, here) : unknown(identity.error());
  return watch;
}

void IdentityWatch::follow(WallTime now) {
  if (reading_.valid()) {
    if (reading_.wait_for(std::chrono::seconds{0}) != std::future_status::ready) return;
    try {
      auto read = reading_.get();
      // The identity that is published stays while the disk does not answer.
      if (read.machine_id.empty() && read.doubt.empty()) read.machine_id = known_.machine_id;
      known_ = std::move(read);
    } catch (const std::exception& error) {
      known_.fault = error.what();
    }
  }
  if (now < next_) return;
  next_ = now + kPeriod;
  reading_ = run_abandonable(
      [dir = data_dir_, here = here_, before = known_] { return read_known(dir, here, before); });
}

void IdentityWatch::restrict(ActiveModelState& state) const {
  if (state.status != v1::ModelStatus::MODEL_ACTIVE && state.status != v1::ModelStatus::MODEL_DRIFT)
    return;
  if (!known_.doubt.empty()) {
    state.status = v1::ModelStatus::MODEL_STALE;
    state.reason = known_.doubt;
  } else if (known_.renewed && state.activated < *known_.renewed) {
    state.status = v1::ModelStatus::MODEL_STALE;
    state.reason =
        "the model is of the machine from which the data folder was copied: calibrate, or check it "
        "and run `abbe model activate` with a reason";
  }
}

StreamHealth IdentityWatch::health(const std::string& twin) const {
  StreamHealth h;
  h.status.name = "identity";
  h.status.connected = known_.doubt.empty() && twin.empty();
  h.status.state = !known_.doubt.empty() ? "not confirmed" : twin.empty() ? "confirmed" : "twin";
  h.status.last_fault = known_.doubt.empty() ? known_.fault : known_.doubt;
  if (!twin.empty()) {
    if (!h.status.last_fault.empty()) h.status.last_fault += "; ";
    h.status.last_fault +=
        fmt::format("another machine publishes with {}: give each its own name and identity", twin);
  }
  return h;
}

}  // namespace abbe::daemon
