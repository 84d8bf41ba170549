#include "abbe/service/identity_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

using Known = IdentityWatch::Known;

/// If the store cannot be read, the models of the other machine are those in `before`. At the start
/// `before` is empty, and no model can be used then.
Known known_from(const MachineIdentity& identity, const ComputerMarks& here,
                 const std::filesystem::path& data_dir, const Known& before) {
  Known known{
      .machine_id = identity.machine_id, .doubt = why_not_confirmed(identity, here), .fault = {}};
  if (identity.renewal() == nullptr) return known;
  if (const auto history = ModelStore{data_dir / "models"}.history())
    known.others = models_of_other_machine(identity, *history);
  else if (before.machine_id == known.machine_id)
    known.others = before.others;
  else if (known.doubt.empty())
    known.doubt = "which models are of the other machine is not known: " + history.error().text;
  return known;
}

/// The result for an identity that cannot be read. A damaged file may hide that a person still has
/// to decide, so no model may be ACTIVE. If the file could not be written at the first start, there
/// is no such doubt.
Known unknown(const Error& error) {
  return {.machine_id = {},
          .doubt = error.code == ErrorCode::BadInput ? error.text : std::string{},
          .fault = error.text};
}

Known read_known(const std::filesystem::path& data_dir, const ComputerMarks& here,
                 const Known& before) {
  const auto identity = read_identity(data_dir);
  if (!identity) return unknown(identity.error());
  return *identity ? known_from(**identity, here, data_dir, before) : before;
}

}  // namespace

IdentityWatch IdentityWatch::open(const std::filesystem::path& data_dir, const ComputerMarks& here,
                                  protocol::UtcTime now) {
  IdentityWatch watch(data_dir, here);
  const auto identity = open_identity(data_dir, here, now);
  watch.known_ = identity ? known_from(*identity, here, data_dir, {}) : unknown(identity.error());
  return watch;
}

void IdentityWatch::follow(WallTime now) {
  if (reading_.valid()) {
    if (!ready(reading_)) return;
    try {
      auto read = reading_.get();
      // While the disk does not answer, the known values stay valid: the identity that is
      // published, and the reasons why no model, or no model of the other machine, may be ACTIVE.
      if (read.machine_id.empty() && read.doubt.empty())
        known_.fault = std::move(read.fault);
      else
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

std::string IdentityWatch::objection_to(const std::string& id) const {
  if (!known_.doubt.empty()) return known_.doubt;
  return std::ranges::binary_search(known_.others, id) ? kOfOtherMachine : "";
}

void IdentityWatch::restrict(ActiveModelState& state) const {
  if (state.status != v1::ModelStatus::MODEL_ACTIVE && state.status != v1::ModelStatus::MODEL_DRIFT)
    return;
  auto objection = objection_to(state.model != nullptr ? state.model->id : std::string{});
  if (objection.empty()) return;
  state.status = v1::ModelStatus::MODEL_STALE;
  state.reason = std::move(objection);
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
