#pragma once
/// The slow half of the model authority: puts judged models into the store and reads which one is
/// active, with all the waiting for disk and locks that takes. For any thread but the hub's; a copy
/// for each. Ordinary world.

#include <atomic>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/calib/gate.hpp"
#include "abbe/config/config.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/publishing/idl_messages.hpp"
#include "abbe/publishing/model_publication.hpp"

namespace abbe::daemon {

/// What the store says is active, read, checked and encoded. Without a model `fault` says why; both
/// empty: nothing is active. The model is shared with an identification that compares with it.
struct ActiveModel {
  StoreEvent activation;  ///< default: nothing was ever activated
  std::shared_ptr<const ModelInForce> model;
  ModelPublication publication;  ///< of `model`
  bool made_for_this_machine = false;
  std::string recording_gap;  ///< ModelDocument::recording_gap
  std::string fault;
};

/// A model that is in the store now.
struct KeptModel {
  std::string id;
  std::optional<ActiveModel> active;  ///< if the gate accepted it
};

class ModelKeeper {
 public:
  /// Does not touch the disk.
  ModelKeeper(const std::filesystem::path& store_folder, const Config& config,
              protocol::UtcOffset utc);

  /// For the start of the daemon: removes what killed processes left in the store and sets a
  /// damaged state aside. Best effort; what does not work out is an error of read_active().
  void tidy_store(protocol::HostTime now);

  /// See ModelStore.
  void set_lock_timeout(std::chrono::nanoseconds patience) noexcept {
    store_.set_lock_timeout(patience);
  }
  /// Keeps a judged model, activates it if the gate accepted it, and reads it back. May be repeated
  /// with the same `actor` after an error: what the store has of it already is not entered again.
  /// Refused, and nothing further done, once `discarded` is true; null: never.
  [[nodiscard]] Result<KeptModel> keep(const ModelDocument& document, const calib::Verdict& verdict,
                                       const StoreActor& actor, protocol::HostTime now,
                                       const std::atomic<bool>* discarded = nullptr);
  /// An error only if the store itself cannot be read; a damaged model is a `fault`.
  [[nodiscard]] Result<ActiveModel> read_active(protocol::HostTime now) const;
  /// The same; a state that is damaged is set aside first. Waits for the store's lock at most
  /// kRenameTimeout.
  [[nodiscard]] Result<ActiveModel> read_active_or_set_aside(protocol::HostTime now);
  static constexpr std::chrono::seconds kRenameTimeout{1};
  /// Whether read_active() may say something else than when this was the same. One system call.
  [[nodiscard]] StoreStamp stamp() const noexcept { return store_.stamp(); }

 private:
  /// The model of `document`, activated as `activation` says, checked and encoded.
  [[nodiscard]] ActiveModel active_of(const StoreEvent& activation, ModelDocument document,
                                      protocol::HostTime now) const;
  [[nodiscard]] Result<void> activate_once(const std::string& id, const StoreActor& actor);

  ModelStore store_;
  std::string machine_;
  std::string machine_hash_;
  protocol::UtcOffset utc_;
};

}  // namespace abbe::daemon
