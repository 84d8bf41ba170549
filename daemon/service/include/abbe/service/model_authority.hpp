#pragma once
/// Holds the active model and determines its status. The time, user and reason of the activation
/// are stored in the model store, so that a restart of the daemon changes neither the age of the
/// model nor its reason.
///
/// - STALE: the model was made for another machine configuration (hash), the axes have not all been
///   seen since the start, or there are no recent axis positions.
/// - DRIFT: a run after the activation found that tables changed by more than their uncertainty,
///   and no model was activated since.
/// - INVALID: the control itself corrects the axis readings, so the model would correct them twice.
///
/// Not real-time; used by the hub's thread only.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/config/config.hpp"
#include "abbe/publishing/publisher.hpp"
#include "abbe/service/identity_watch.hpp"
#include "abbe/service/model_keeper.hpp"

namespace abbe::daemon {

class ModelAuthority {
 public:
  /// Loads the active model of the store, if there is one. A damaged model is reported in
  /// model_state() and not used. A store that can be neither read nor created (read-only disk,
  /// permission, damage) is reported in fault(), and follow_store() tries again to read it;
  /// acquisition does not wait for the store.
  [[nodiscard]] static ModelAuthority open(const std::filesystem::path& store_folder,
                                           const Config& config, WallClock clock,
                                           protocol::HostTime now);

  /// A copy of the keeper, with which another thread stores a model. The hub's thread then calls
  /// set_active() with the active model that the keeper returned.
  [[nodiscard]] ModelKeeper keeper() const { return keeper_; }
  /// Makes `active` the active model. The model that was active before is destroyed on an ordinary
  /// thread, because that may take long.
  void set_active(ActiveModel active);
  /// As set_active(active), for a model that another thread began to read or store when revision()
  /// was `since`. If another model has become active since then, `active` may be the older one. It
  /// is then not used, and the next follow_store() reads the store again.
  void set_active(ActiveModel active, std::uint64_t since);
  /// Reports that model `id` has drifted; no effect if it is not the active model. `drift` states
  /// what changed. The report applies until the store has recorded the drift, or a new model is
  /// active.
  void raise_drift(const std::string& id, std::string drift);
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  enum class Following : std::uint8_t { Unchanged, Reading, Replaced };
  /// Follows activations and rollbacks that another process made in the store (`abbe model ...`).
  /// Never waits and never accesses the disk: one call starts a background task, which reads the
  /// store if its file changed, and a later call takes the result.
  /// - A damaged state file that is unchanged at the second reading is renamed. The active model
  ///   stays active until another one is activated.
  /// - A store that cannot be read, or has not answered for kStoreTimeout, is reported in
  ///   model_state() and fault(), and read again.
  Following follow_store(protocol::HostTime now);
  static constexpr std::chrono::seconds kStoreTimeout{5};
  /// The reason why the last attempt to read the store, or its active model, failed. Empty if both
  /// were read.
  [[nodiscard]] const std::string& fault() const noexcept {
    return fault_.empty() ? active_.fault : fault_;
  }

  /// `axes_known_at`: the last time at which all axis positions were known. The model is STALE if
  /// this time is longer ago than `patience`; the reason then includes `why_not_known` if it is not
  /// empty.
  [[nodiscard]] ActiveModelState model_state(protocol::HostTime now,
                                             std::optional<protocol::HostTime> axes_known_at,
                                             std::chrono::nanoseconds patience,
                                             std::string_view why_not_known = {}) const;
  [[nodiscard]] const PublishedModel* active_model() const noexcept { return active_.model.get(); }
  /// The model with which the gate compares a new one: the active model. Null if the active model
  /// was made for another machine configuration, or if the identity of the machine does not allow
  /// its use.
  [[nodiscard]] std::shared_ptr<const PublishedModel> comparison_model() const;
  /// Restricts comparison_model(). `identity` must exist at every later call; null: no restriction.
  void set_identity(const IdentityWatch* identity) noexcept { identity_ = identity; }

 private:
  ModelAuthority(ModelKeeper keeper, bool axes_compensated);
  [[nodiscard]] ActiveModelState state_by_store(protocol::HostTime now,
                                                std::optional<protocol::HostTime> axes_known_at,
                                                std::chrono::nanoseconds patience,
                                                std::string_view why_not_known) const;

  /// Result of reading the store on an ordinary thread.
  struct Look {
    StoreStamp stamp;
    std::optional<ActiveModel> active = {};  ///< nullopt: not read, because the stamp is unchanged
    std::string fault = {};                  ///< reason why the store could not be read
  };
  void begin_to_look(protocol::HostTime now);
  Following conclude_look(Result<Look> look, protocol::HostTime now);
  Following report_look(std::string fault);

  ModelKeeper keeper_;
  bool axes_compensated_;
  const IdentityWatch* identity_ = nullptr;
  std::optional<StoreStamp> seen_;    // stamp of the store when `active_` was read
  bool read_again_ = false;           // read the store even if its stamp is unchanged
  std::optional<StoreStamp> failed_;  // stamp of the store when the last reading failed
  ActiveModel active_;
  std::string fault_;
  protocol::HostTime next_repair_{};
  std::uint64_t revision_ = 0;
  std::uint64_t looking_since_ = 0;  // revision_ at the time when the reading began
  protocol::HostTime looking_from_{};
  std::future<Result<Look>> looking_;
};

}  // namespace abbe::daemon
