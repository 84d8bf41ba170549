#include "abbe/daemon/model_keeper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/daemon/cdr.hpp"

namespace abbe::daemon {
namespace {

/// The hash of what the model was identified from, as its document names it; empty if it names nothing.
std::string provenance(const ModelDocument& document) {
  return document.inputs.empty() ? std::string{} : document.inputs.front().sha256;
}

Result<void> check_publishable(const ModelInForce& model, protocol::HostTime now) {
  std::vector<std::byte> unused;
  if (auto encoded = encode(model_message(model, {.now = now}), unused); !encoded) {
    return fail(ErrorCode::Refused,
                fmt::format("model {} cannot be published: {}", model.id, encoded.error().text));
  }
  return {};
}

}  // namespace

Result<ModelKeeper> ModelKeeper::open(const std::filesystem::path& store_folder, const Config& config,
                                      protocol::UtcOffset utc) {
  auto store = ModelStore::open(store_folder);
  if (!store) return tl::unexpected(store.error());
  return ModelKeeper{std::move(*store), machine_hash(config), utc};
}

Result<KeptModel> ModelKeeper::keep(const ModelDocument& document, const calib::Verdict& verdict,
                                    const StoreActor& actor, protocol::HostTime now) {
  const auto id = store_.add(document, verdict.accepted, verdict.reasons, actor);
  if (!id) return tl::unexpected(id.error());
  if (!verdict.accepted) return KeptModel{*id, std::nullopt};
  if (auto done = store_.activate(*id, actor); !done) return tl::unexpected(done.error());
  auto active = read_active(now);
  if (!active) return tl::unexpected(active.error());
  return KeptModel{*id, std::move(*active)};
}

Result<ActiveModel> ModelKeeper::read_active(protocol::HostTime now) const {
  const auto activation = store_.activation();
  if (!activation) return tl::unexpected(activation.error());
  ActiveModel active;
  if (!*activation) return active;
  active.activation = **activation;
  auto document = store_.load(active.activation.id);
  if (!document) {
    active.fault = document.error().text;
    return active;
  }
  active.made_for_this_machine = document->machine_hash == machine_hash_;
  active.model.emplace(ModelInForce{.id = active.activation.id,
                                    .method = document->method,
                                    .estimator = document->estimator,
                                    .recording_sha256 = provenance(*document),
                                    .created = document->created,
                                    .active_since = std::min(now, utc_.to_host(active.activation.actor.when)),
                                    .model = std::move(document->model)});
  if (const auto fine = check_publishable(*active.model, now); !fine) {
    active.model.reset();
    active.fault = fine.error().text;
  }
  return active;
}

}  // namespace abbe::daemon
