#include "abbe/service/model_keeper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "abbe/calib/iso/standard_values.hpp"
#include "abbe/result/try.hpp"

namespace abbe::daemon {
namespace {

/// SHA-256 of the first input of the model; empty if the document lists no input.
std::string provenance(const ModelDocument& document) {
  return document.inputs.empty() ? std::string{} : document.inputs.front().sha256;
}

std::optional<double> largest_U_m(const calib::VolumetricModel& model) {
  const auto volume = calib::iso::volume_error(model);
  return volume ? std::optional(volume->max_U_m) : std::nullopt;
}

std::string not_known_since(const std::string& damaged_state) {
  return fmt::format(
      "which model was active is not known: the store's state was damaged and is kept as {}; "
      "activate one with `abbe model activate ID --force --why ...`, or calibrate",
      damaged_state);
}

}  // namespace

ModelKeeper::ModelKeeper(const std::filesystem::path& store_folder, const Config& config,
                         WallClock clock)
    : store_(store_folder),
      machine_(config.machine.name),
      configuration_(std::make_shared<const PresentConfiguration>(present_configuration(config))),
      clock_(std::move(clock)) {}

void ModelKeeper::tidy_store() {
  store_.remove_leftovers();
  (void)store_.rename_damaged_state(clock_.now());
}

Result<KeptModel> ModelKeeper::keep(const ModelDocument& document, const calib::Verdict& verdict,
                                    const StoreActor& actor, protocol::HostTime now,
                                    const std::atomic<bool>* discarded, const KeptBeside& beside) {
  const auto is_discarded = [discarded] { return discarded != nullptr && *discarded; };
  ABBE_TRY(store_.create());
  if (is_discarded()) return fail(ErrorCode::Refused, "the model was discarded");
  ABBE_TRY(keep_beside(beside, actor));
  const auto id = store_.add(document, verdict.accepted, verdict.reasons, actor);
  ABBE_TRY(id);
  if (is_discarded()) return fail(ErrorCode::Refused, "the model was discarded");
  if (!verdict.accepted || beside.hold) return KeptModel{*id, std::nullopt};
  ABBE_TRY(activate_once(*id, actor));

  auto active = active_after(*id, document, now);
  ABBE_TRY(active);
  return KeptModel{*id, std::move(*active)};
}

Result<void> ModelKeeper::keep_beside(const KeptBeside& beside, const StoreActor& actor) {
  if (beside.run) {
    const auto run = store_.add(*beside.run, beside.run_accepted, beside.run_reasons, actor);
    ABBE_TRY(run);
  }
  if (beside.drift.empty()) return {};
  return store_.add_drift(beside.drifted_model, {actor.who, beside.drift, actor.when});
}

/// The active model after `document` was activated. The model file in the store is read only if the
/// active model is not exactly `document`: another process has activated another model meanwhile,
/// or the same model was stored earlier with other dates or inputs.
Result<ActiveModel> ModelKeeper::active_after(const std::string& id, const ModelDocument& document,
                                              protocol::HostTime now) const {
  const auto activation = store_.activation();
  ABBE_TRY(activation);
  const bool same = *activation && (*activation)->id == id && store_.holds(id, document);
  return same ? active_of(**activation, document, now) : read_active(now);
}

Result<void> ModelKeeper::activate_once(const std::string& id, const StoreActor& actor) {
  const auto history = store_.history();
  ABBE_TRY(history);
  const bool done = std::ranges::any_of(*history, [&](const StoreEvent& event) {
    return event.action == StoreAction::Activated && event.id == id && event.actor == actor;
  });
  return done ? Result<void>{} : store_.activate(id, actor);
}

Result<ActiveModel> ModelKeeper::read_active_or_set_aside(protocol::HostTime now) {
  auto active = read_active(now);
  if (active) return active;
  store_.set_lock_timeout(kRenameTimeout);
  if (const auto renamed = store_.rename_damaged_state(clock_.now()); !renamed)
    return fail(active.error().code,
                fmt::format("{}; {}", active.error().text, renamed.error().text));
  return read_active(now);
}

Result<ActiveModel> ModelKeeper::read_active(protocol::HostTime now) const {
  ABBE_TRY(store_.create());
  const auto activation = store_.activation();
  ABBE_TRY(activation);
  ActiveModel active;

  if (!*activation) {
    if (const auto damaged = store_.damaged_state(); !damaged.empty())
      active.fault = not_known_since(damaged);
    return active;
  }

  auto document = store_.load((*activation)->id);
  const auto drift = store_.drift();
  ABBE_TRY(drift);
  if (document) {
    active = active_of(**activation, std::move(*document), now);
    active.drift = *drift;
    return active;
  }

  active.activation = **activation;
  active.fault = document.error().text;
  return active;
}

ActiveModel ModelKeeper::active_of(const StoreEvent& activation, ModelDocument document,
                                   protocol::HostTime now) const {
  ActiveModel active{.activation = activation};
  active.unfit = unfit_for(document, *configuration_, activation.accepted_configuration);
  active.measured_otherwise = changed_measurements(document, *configuration_);
  active.recording_gap = document.recording_gap;
  auto model = std::make_shared<const PublishedModel>(PublishedModel{
      .id = activation.id,
      .method = document.method,
      .estimator = document.estimator,
      .recording_sha256 = provenance(document),
      .created = document.created,
      .active_since = std::min(now, clock_.offset(now).to_host(activation.actor.when)),
      .hash = model_hash(document),
      .largest_U_m = largest_U_m(document.model),
      .simulated = made_on_simulated_devices(document).value_or(false),
      .tracker_place = std::move(document.tracker_place),
      .model = std::move(document.model)});
  auto publication = encode_model(*model, machine_);

  if (!publication) {
    active.fault = publication.error().text;
    return active;
  }

  active.model = std::move(model);
  active.publication = std::move(*publication);
  return active;
}

}  // namespace abbe::daemon
