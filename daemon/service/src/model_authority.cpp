#include "abbe/service/model_authority.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <utility>

#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

// A model file that cannot be used is read again with this period, because a person may repair it
// or restore it from a backup, which does not change the stamp of the store.
constexpr auto kRepairPeriod = std::chrono::seconds{10};

/// The reasons why the gate refused the active model; empty: it accepted the model, or the reasons
/// are not known.
std::string refusal_of(const StoreEvent& activation) {
  return fmt::format("{}", fmt::join(activation.reasons, "; "));
}

/// The reason of the state ACTIVE: the gate accepted the model, or a user, who is named, forced its
/// activation.
std::string reason_of(const StoreEvent& activation) {
  const std::string refused = refusal_of(activation);
  const auto done_by = [&](std::string_view what) {
    const auto& [who, why, when] = activation.actor;
    return fmt::format("{} by {}{}{}{}{}", what, who, why.empty() ? "" : ": ", why,
                       refused.empty() ? "" : "; the gate had refused it: ", refused);
  };

  switch (activation.action) {
    case StoreAction::Forced:
      return done_by("forced");
    case StoreAction::RolledBack:
      return done_by(activation.accepted ? "rolled back"
                                         : "rolled back to a model the gate did not accept,");
    case StoreAction::Activated:
      if (!activation.accepted_configuration.empty())
        return done_by("accepted with the configuration hash of an earlier version");
      break;
    case StoreAction::Added:
    case StoreAction::Drifted:
    case StoreAction::Removed:
      break;
  }

  return "accepted by the gate";
}

bool same(const StoreEvent& a, const StoreEvent& b) {
  return a.id == b.id && a.actor.when == b.actor.when && a.action == b.action;
}

}  // namespace

ModelAuthority::ModelAuthority(ModelKeeper keeper, bool axes_compensated)
    : keeper_(std::move(keeper)), axes_compensated_(axes_compensated), seen_(keeper_.stamp()) {}

ModelAuthority ModelAuthority::open(const std::filesystem::path& store_folder, const Config& config,
                                    WallClock clock, HostTime now) {
  ModelKeeper keeper{store_folder, config, std::move(clock)};
  keeper.tidy_store();
  ModelAuthority authority{std::move(keeper), config.axes_compensated()};
  if (auto active = authority.keeper_.read_active(now)) {
    authority.set_active(std::move(*active));
  } else {
    authority.active_.fault = active.error().text;
    authority.read_again_ = true;
  }
  return authority;
}

void ModelAuthority::set_active(ActiveModel active) {
  destroy_in_background(std::exchange(active_, std::move(active)));
  ++revision_;
}

void ModelAuthority::set_active(ActiveModel active, std::uint64_t since) {
  if (since == revision_) {
    set_active(std::move(active));
  } else {
    read_again_ = true;
    destroy_in_background(std::move(active));
  }
}

void ModelAuthority::raise_drift(const std::string& id, std::string drift) {
  if (active_.model != nullptr && active_.model->id == id) active_.drift = std::move(drift);
}

std::shared_ptr<const PublishedModel> ModelAuthority::comparison_model() const {
  if (active_.model == nullptr || !active_.unfit.empty()) return nullptr;
  const bool objected = identity_ != nullptr && !identity_->objection_to(active_.model->id).empty();
  return objected ? nullptr : active_.model;
}

ModelAuthority::Following ModelAuthority::follow_store(HostTime now) {
  if (!looking_.valid()) begin_to_look(now);
  if (ready(looking_)) return conclude_look(outcome_of(looking_), now);
  if (now - looking_from_ > kStoreTimeout)
    fault_ = fmt::format("the model store has not answered for {} s", kStoreTimeout.count());
  return Following::Reading;
}

void ModelAuthority::begin_to_look(HostTime now) {
  const bool to_repair = !active_.fault.empty() && now >= next_repair_;
  const bool read_anyway = std::exchange(read_again_, false) || to_repair;
  looking_from_ = now;
  looking_since_ = revision_;

  looking_ = run_abandonable([keeper = keeper_, seen = seen_, failed = failed_, read_anyway,
                              now]() mutable -> Result<Look> {
    Look look{.stamp = keeper.stamp()};
    if (look.stamp == seen && !read_anyway) return look;
    // A damaged state file is renamed only at the second reading of the same content: at the first,
    // another process may be writing the file.
    auto active =
        look.stamp == failed ? keeper.read_active_or_set_aside(now) : keeper.read_active(now);
    if (active)
      look.active = std::move(*active);
    else
      look.fault = std::move(active.error().text);
    return look;
  });
}

/// Keeps the active model although reading the store failed. The fault is reported in model_state()
/// and in health(), and the next call reads the store again.
ModelAuthority::Following ModelAuthority::report_look(std::string fault) {
  fault_ = std::move(fault);
  read_again_ = true;
  return Following::Unchanged;
}

ModelAuthority::Following ModelAuthority::conclude_look(Result<Look> look, HostTime now) {
  if (!look) return report_look(look.error().text);
  failed_.reset();
  if (!look->fault.empty()) {
    failed_ = look->stamp;
    return report_look(std::move(look->fault));
  }

  seen_ = look->stamp;
  fault_.clear();
  if (!look->active) return Following::Unchanged;
  const bool unknown = look->active->activation.id.empty() && !look->active->fault.empty();
  if (unknown && active_.model != nullptr) return report_look(std::move(look->active->fault));
  next_repair_ = now + kRepairPeriod;

  if (same(look->active->activation, active_.activation) && look->active->fault == active_.fault &&
      look->active->drift == active_.drift) {
    destroy_in_background(std::move(*look->active));
    return Following::Unchanged;
  }

  const auto before = revision_;
  set_active(std::move(*look->active), looking_since_);
  return revision_ == before ? Following::Unchanged : Following::Replaced;
}

ActiveModelState ModelAuthority::model_state(HostTime now, std::optional<HostTime> axes_known_at,
                                             std::chrono::nanoseconds patience,
                                             std::string_view why_not_known) const {
  ActiveModelState s = state_by_store(now, axes_known_at, patience, why_not_known);
  if (!fault_.empty() && fault_ != s.reason)
    s.reason += fmt::format("; later activations are not known: {}", fault_);
  return s;
}

ActiveModelState ModelAuthority::state_by_store(HostTime now, std::optional<HostTime> axes_known_at,
                                                std::chrono::nanoseconds patience,
                                                std::string_view why_not_known) const {
  ActiveModelState s{.model = active_model(), .revision = revision_};
  if (s.model != nullptr) s.publication = &active_.publication;
  if (s.model != nullptr) s.refused = refusal_of(active_.activation);
  if (!active_.model) {
    s.status = active_.fault.empty() ? v1::ModelStatus::MODEL_NONE : v1::ModelStatus::MODEL_INVALID;
    s.reason = active_.fault.empty() ? "no model has been activated" : active_.fault;
    return s;
  }

  s.status = v1::ModelStatus::MODEL_STALE;
  if (axes_compensated_) {
    s.status = v1::ModelStatus::MODEL_INVALID;
    s.reason = "the control already corrects these axes: axes_compensated = true";
  } else if (!active_.unfit.empty()) {
    s.reason = active_.unfit;
  } else if (!axes_known_at || now - *axes_known_at > patience) {
    s.reason = axes_known_at ? "no recent axis positions" : "no axis positions yet";
    if (!why_not_known.empty()) s.reason += fmt::format(": {}", why_not_known);
  } else if (!active_.drift.empty()) {
    s.status = v1::ModelStatus::MODEL_DRIFT;
    s.reason = active_.drift;
  } else {
    s.status = v1::ModelStatus::MODEL_ACTIVE;
    s.reason = reason_of(active_.activation);
    if (!active_.measured_otherwise.empty())
      s.reason += "; since the model was made: " + active_.measured_otherwise;
    if (!active_.recording_gap.empty()) s.reason += "; " + cannot_be_checked(active_.recording_gap);
  }

  return s;
}

}  // namespace abbe::daemon
