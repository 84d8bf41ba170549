#include "abbe/daemon/model_authority.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/daemon/cdr.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

/// The hash of what the model was identified from, as its document names it; empty if it names nothing.
std::string provenance(const ModelDocument& document) {
  return document.inputs.empty() ? std::string{} : document.inputs.front().sha256;
}

/// Why the model may be used: a person who forced it answers for it by name.
std::string reason_of(const StoreEvent& activation) {
  const auto said_by = [&activation](std::string_view what) {
    const auto& [who, why, when] = activation.actor;
    return fmt::format("{} by {}{}{}", what, who, why.empty() ? "" : ": ", why);
  };
  switch (activation.action) {
    case StoreAction::Forced:
      return said_by("forced");
    case StoreAction::RolledBack:
      return said_by(activation.accepted ? "rolled back" : "rolled back to a model the gate did not accept,");
    case StoreAction::Added:
    case StoreAction::Activated:
      break;
  }
  return "accepted by the gate";
}

}  // namespace

ModelAuthority::ModelAuthority(ModelStore store, const Config& config, protocol::UtcOffset utc)
    : store_(std::move(store)),
      machine_hash_(machine_hash(config)),
      axes_compensated_(config.encoder && config.encoder->axes_compensated),
      utc_(utc) {}

Result<ModelAuthority> ModelAuthority::open(const std::filesystem::path& store_folder, const Config& config,
                                            protocol::UtcOffset utc, HostTime now) {
  auto store = ModelStore::open(store_folder);
  if (!store) return tl::unexpected(store.error());
  ModelAuthority authority{std::move(*store), config, utc};
  if (auto taken = authority.take_up_active(now); !taken) authority.fault_ = taken.error().text;
  return authority;
}

Result<void> ModelAuthority::take_up_active(HostTime now) {
  const auto activation = store_.activation();
  if (!activation) return tl::unexpected(activation.error());
  in_force_.reset();
  fault_.clear();
  ++revision_;
  activation_ = activation->value_or(StoreEvent{});
  if (!*activation) return {};
  auto document = store_.load(activation_.id);
  if (!document) return tl::unexpected(document.error());
  made_for_this_machine_ = document->machine_hash == machine_hash_;
  in_force_.emplace(ModelInForce{.id = activation_.id,
                                 .method = document->method,
                                 .estimator = document->estimator,
                                 .recording_sha256 = provenance(*document),
                                 .created = document->created,
                                 .active_since = std::min(now, utc_.to_host(activation_.actor.when)),
                                 .model = std::move(document->model)});
  std::vector<std::byte> unused;
  if (auto encoded = encode(model_message(*in_force_, {.now = now}), unused); !encoded) {
    in_force_.reset();
    return fail(ErrorCode::Refused,
                fmt::format("model {} cannot be published: {}", activation_.id, encoded.error().text));
  }
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
  const auto activation = store_.activation();
  if (!activation) return false;  // being replaced, or damaged: what is in force stays
  const bool same = activation->has_value() ? (*activation)->id == activation_.id &&
                                                  (*activation)->actor.when == activation_.actor.when
                                            : !in_force_ && fault_.empty();
  if (same) return false;
  if (auto taken = take_up_active(now); !taken) fault_ = taken.error().text;
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
  if (axes_compensated_) {
    s.status = v1::ModelStatus::MODEL_INVALID;
    s.reason = "the control already corrects these axes: [encoder] axes_compensated = true";
  } else if (!made_for_this_machine_) {
    s.reason = "the model was made for another machine configuration";
  } else if (!axes_known_at) {
    s.reason = "no axis positions yet";
  } else if (now - *axes_known_at > patience) {
    s.reason = "no recent axis positions";
  } else {
    s.status = v1::ModelStatus::MODEL_ACTIVE;
    s.reason = reason_of(activation_);
  }
  return s;
}

}  // namespace abbe::daemon
