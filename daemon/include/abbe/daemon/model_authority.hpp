#pragma once
/// Which model is in force, and what may be said of it. The store is the memory; when and by whom a model was
/// activated is the store's to say, so that a restart changes neither its age nor its reason. After a restart
/// the active model is STALE until the machine's configuration hash agrees with the one the model was made
/// for and all axes have been seen; without recent axis positions it is STALE again. Where the control
/// corrects the axis readings itself it is INVALID: applied, it would correct twice. Ordinary world; used by
/// the hub's thread only.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <future>
#include <optional>
#include <string>

#include "abbe/daemon/config.hpp"
#include "abbe/daemon/model_keeper.hpp"
#include "abbe/daemon/publisher.hpp"

namespace abbe::daemon {

class ModelAuthority {
 public:
  /// Takes up the active model of the store, if there is one. A damaged one is said in standing() and not
  /// used.
  [[nodiscard]] static Result<ModelAuthority> open(const std::filesystem::path& store_folder,
                                                   const Config& config, protocol::UtcOffset utc,
                                                   protocol::HostTime now);

  /// For putting a model into the store on another thread; what it says is active then goes to take_up().
  [[nodiscard]] ModelKeeper keeper() const { return keeper_; }
  void take_up(ActiveModel active);
  /// The same for what began to be read when revision() was `since`: if another model was taken up meanwhile,
  /// this one may be the older and the next follow_store() reads the store again instead.
  void take_up(ActiveModel active, std::uint64_t since);
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  enum class Following : std::uint8_t { Unchanged, Reading, TakenUp };
  /// Takes up another model if somebody has activated or rolled back one in the store (`abbe model ...`
  /// does). Never waits: the store is read on a thread of its own when its file has changed, and asked for
  /// again. A store that cannot be read is said in standing() and fault(), and read again at every call.
  Following follow_store(protocol::HostTime now);
  /// Why the store could not be read the last time; empty: it could.
  [[nodiscard]] const std::string& fault() const noexcept { return fault_; }

  /// `axes_known_at`: the latest instant all axes were known; `patience`: how long that may be ago.
  [[nodiscard]] ModelStanding standing(protocol::HostTime now,
                                       std::optional<protocol::HostTime> axes_known_at,
                                       std::chrono::nanoseconds patience) const;
  [[nodiscard]] const ModelInForce* in_force() const noexcept {
    return active_.model ? &*active_.model : nullptr;
  }
  /// What a new model must be better than: the one in force, if it was made for this machine configuration.
  [[nodiscard]] const calib::VolumetricModel* to_beat() const noexcept {
    return active_.model && active_.made_for_this_machine ? &active_.model->model : nullptr;
  }

 private:
  ModelAuthority(ModelKeeper keeper, bool axes_compensated);
  [[nodiscard]] ModelStanding standing_by_store(protocol::HostTime now,
                                                std::optional<protocol::HostTime> axes_known_at,
                                                std::chrono::nanoseconds patience) const;

  ModelKeeper keeper_;
  bool axes_compensated_;
  // Of the store as `active_` was read from it, or as it is being read; none: it is to be read again.
  std::optional<StoreStamp> seen_;
  ActiveModel active_;
  std::string fault_;
  protocol::HostTime next_repair_{};
  std::uint64_t revision_ = 0;
  std::uint64_t reading_since_ = 0;  // revision_ when the reading began
  std::future<Result<ActiveModel>> reading_;
};

}  // namespace abbe::daemon
