#pragma once
/// The blocking part of the model authority: stores models with their verdicts, and reads the
/// active model. The calls wait for disk and locks, so they are for any thread except the hub's;
/// each thread uses its own copy. Not real-time.

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/wall_clock.hpp"
#include "abbe/calib/model/gate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/model/configuration_fit.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/publishing/idl_messages.hpp"
#include "abbe/publishing/model_publication.hpp"

namespace abbe::daemon {

/// The active model of the store, checked and encoded. If `model` is null, `fault` gives the cause;
/// if `fault` is empty, too, no model is active. An identification whose result is compared with
/// the model shares ownership of the model.
struct ActiveModel {
  StoreEvent activation;  ///< default-constructed: no model has been activated
  std::shared_ptr<const PublishedModel> model;
  ModelPublication publication;  ///< encoded messages of `model`
  /// The reason why the readings do not have the meaning that they had when the model was made.
  /// Empty: they have this meaning, or a person accepted the model for this configuration.
  std::string unfit{};
  std::string measured_otherwise{};  ///< changed_measurements()
  std::string recording_gap;         ///< ModelDocument::recording_gap
  std::string drift;  ///< ModelStore::drift(); empty: no drift was found since the activation
  std::string fault;
};

/// Result of storing a model.
struct KeptModel {
  std::string id;
  /// The model that is active after the call. nullopt: the gate refused the given model, or it is
  /// not activated because of [drift] hold.
  std::optional<ActiveModel> active;
};

/// Data that are stored together with an identified model.
struct KeptBeside {
  /// The active model with which the run was compared, and what changed since; empty: no drift.
  std::string drifted_model{}, drift{};
  bool hold = false;  ///< do not activate the model, although the gate accepts it
  /// If the identified model is an update of the active model: the model of the run alone.
  std::optional<ModelDocument> run{};
  bool run_accepted = false;
  std::vector<std::string> run_reasons{};
};

class ModelKeeper {
 public:
  /// Does not access the disk.
  ModelKeeper(const std::filesystem::path& store_folder, const Config& config, WallClock clock);

  /// For the start of the daemon: removes files that killed processes left in the store, and
  /// renames a damaged state file. Ignores errors; read_active() returns them.
  void tidy_store();

  /// Sets a shorter time-out for the lock, see ModelStore::set_lock_timeout().
  void set_lock_timeout(std::chrono::nanoseconds patience) noexcept {
    store_.set_lock_timeout(patience);
  }
  /// Stores a model with its verdict, activates it if the gate accepted it, and returns the active
  /// model of the store. Before the activation the store parses and checks the file that it wrote.
  /// The returned model is that of `document` if the file has the same bytes.
  ///
  /// A drift is recorded before the activation.
  ///
  /// After an error the call may be repeated with the same `actor`; entries that the store already
  /// has are not added again. Returns Refused as soon as `discarded` is true; `discarded` may be
  /// null.
  [[nodiscard]] Result<KeptModel> keep(const ModelDocument& document, const calib::Verdict& verdict,
                                       const StoreActor& actor, protocol::HostTime now,
                                       const std::atomic<bool>* discarded = nullptr,
                                       const KeptBeside& beside = {});
  /// An error only if the store itself cannot be read; a damaged model is reported in
  /// ActiveModel::fault.
  [[nodiscard]] Result<ActiveModel> read_active(protocol::HostTime now) const;
  /// Same as read_active(). If that fails, renames a damaged state file and reads again. Waits for
  /// the store's lock at most kRenameTimeout.
  [[nodiscard]] Result<ActiveModel> read_active_or_set_aside(protocol::HostTime now);
  static constexpr std::chrono::seconds kRenameTimeout{1};
  /// While the stamp is unchanged, read_active() gives the same result. One system call.
  [[nodiscard]] StoreStamp stamp() const noexcept { return store_.stamp(); }

 private:
  /// The model of `document` with the data of its `activation`, checked and encoded.
  [[nodiscard]] ActiveModel active_of(const StoreEvent& activation, ModelDocument document,
                                      protocol::HostTime now) const;
  [[nodiscard]] Result<ActiveModel> active_after(const std::string& id,
                                                 const ModelDocument& document,
                                                 protocol::HostTime now) const;
  [[nodiscard]] Result<void> activate_once(const std::string& id, const StoreActor& actor);
  [[nodiscard]] Result<void> keep_beside(const KeptBeside& beside, const StoreActor& actor);

  ModelStore store_;
  std::string machine_;
  std::shared_ptr<const PresentConfiguration> configuration_;
  WallClock clock_;
};

}  // namespace abbe::daemon
