#include "abbe/daemon/model_authority.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::daemon {
namespace {

using protocol::HostTime;

/// The hash of what the model was identified from, as its document names it; empty if it names nothing.
std::string provenance(const ModelDocument& document) {
  return document.inputs.empty() ? std::string{} : document.inputs.front().sha256;
}

}  // namespace

Result<ModelAuthority> ModelAuthority::open(const std::filesystem::path& store_folder,
                                            const MachineConfig& machine, HostTime now) {
  auto store = ModelStore::open(store_folder);
  if (!store) return tl::unexpected(store.error());
  ModelAuthority authority{std::move(*store), machine_hash(machine)};
  if (auto taken = authority.take_up_active(now); !taken) authority.fault_ = taken.error().text;
  return authority;
}

Result<void> ModelAuthority::take_up_active(HostTime now) {
  const auto id = store_.active_id();
  if (!id) return tl::unexpected(id.error());
  in_force_.reset();
  fault_.clear();
  ++revision_;
  if (!*id) return {};
  auto document = store_.load(**id);
  if (!document) return tl::unexpected(document.error());
  made_for_this_machine_ = document->machine_hash == machine_hash_;
  in_force_.emplace(ModelInForce{.id = **id,
                                 .method = document->method,
                                 .estimator = document->estimator,
                                 .recording_sha256 = provenance(*document),
                                 .created = document->created,
                                 .active_since = now,
                                 .model = std::move(document->model)});
  return {};
}

Result<std::string> ModelAuthority::add(const ModelDocument& document, const calib::Verdict& verdict,
                                        const StoreActor& actor, HostTime now) {
  auto id = store_.add(document, verdict.accepted, verdict.reasons, actor);
  if (!id || !verdict.accepted) return id;
  if (auto done = store_.activate(*id, actor); !done) return tl::unexpected(done.error());
  if (auto taken = take_up_active(now); !taken) return tl::unexpected(taken.error());
  return id;
}

bool ModelAuthority::follow_store(HostTime now) {
  const auto id = store_.active_id();
  if (!id) return false;  // being replaced, or damaged: what is in force stays
  const bool same = id->has_value() ? in_force_ && in_force_->id == **id : !in_force_;
  if (same || (!in_force_ && !fault_.empty() && fault_id_ == *id)) return false;
  if (auto taken = take_up_active(now); !taken) {
    fault_ = taken.error().text;
    fault_id_ = *id;
  }
  return true;
}

ModelStanding ModelAuthority::standing(HostTime now, std::optional<HostTime> axes_known_at,
                                       std::chrono::nanoseconds patience) const {
  ModelStanding s{.model = in_force(), .revision = revision_};
  if (!in_force_) {
    s.status = fault_.empty() ? v1::ModelStatus::MODEL_NONE : v1::ModelStatus::MODEL_INVALID;
    s.reason = fault_.empty() ? "no model has been activated" : fault_;
    return s;
  }
  s.status = v1::ModelStatus::MODEL_STALE;
  if (!made_for_this_machine_) {
    s.reason = "the model was made for another machine configuration";
  } else if (!axes_known_at) {
    s.reason = "no axis positions yet";
  } else if (now - *axes_known_at > patience) {
    s.reason = "no recent axis positions";
  } else {
    s.status = v1::ModelStatus::MODEL_ACTIVE;
    s.reason = "accepted by the gate";
  }
  return s;
}

}  // namespace abbe::daemon
