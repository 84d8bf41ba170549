#pragma once
/// Which model is in force, and what may be said of it. The store is the memory; when and by whom a
/// model was activated is the store's to say, so that a restart changes neither its age nor its
/// reason. After a restart the active model is STALE until the machine's configuration hash agrees
/// with the one the model was made for and all axes have been seen; without recent axis positions
/// it is STALE again. Where the control corrects the axis readings itself it is INVALID: applied,
/// it would correct twice. Ordinary world; used by the hub's thread only.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "abbe/config/config.hpp"
#include "abbe/publishing/publisher.hpp"
#include "abbe/service/model_keeper.hpp"

namespace abbe::daemon {

class ModelAuthority {
 public:
  /// Takes up the active model of the store, if there is one. A damaged one is said in standing()
  /// and not used. A store that cannot be read or made (read-only disk, permission, damaged) is a
  /// fault(), and read again by follow_store(): acquisition does not wait for it.
  [[nodiscard]] static ModelAuthority open(const std::filesystem::path& store_folder,
                                           const Config& config, protocol::UtcOffset utc,
                                           protocol::HostTime now);

  /// For putting a model into the store on another thread; what it says is active then goes to
  /// take_up().
  [[nodiscard]] ModelKeeper keeper() const { return keeper_; }
  /// The model of before is destroyed on an ordinary thread.
  void take_up(ActiveModel active);
  /// The same for what began to be read when revision() was `since`: if another model was taken up
  /// meanwhile, this one may be the older and the next follow_store() reads the store again
  /// instead.
  void take_up(ActiveModel active, std::uint64_t since);
  [[nodiscard]] std::uint64_t revision() const noexcept { return revision_; }

  enum class Following : std::uint8_t { Unchanged, Reading, TakenUp };
  /// Takes up another model if somebody has activated or rolled back one in the store
  /// (`abbe model ...` does). Never waits and never touches the disk: a call begins to look on an
  /// ordinary thread, which reads the store if its file has changed, and a later call takes the
  /// outcome. A damaged state that a second look finds as the first did is set aside; the model in
  /// force stays until one is activated. A store that cannot be read, or has not answered for
  /// kStoreTimeout, is reported in standing() and fault(), and read again.
  Following follow_store(protocol::HostTime now);
  static constexpr std::chrono::seconds kStoreTimeout{5};
  /// Why the store, or the model it says is active, could not be read the last time; empty: it
  /// could.
  [[nodiscard]] const std::string& fault() const noexcept {
    return fault_.empty() ? active_.fault : fault_;
  }

  /// `axes_known_at`: the latest instant all axes were known; `patience`: how long that may be ago.
  [[nodiscard]] ModelStanding standing(protocol::HostTime now,
                                       std::optional<protocol::HostTime> axes_known_at,
                                       std::chrono::nanoseconds patience) const;
  [[nodiscard]] const ModelInForce* in_force() const noexcept { return active_.model.get(); }
  /// What a new model must be better than: the one in force, if it was made for this machine
  /// configuration.
  [[nodiscard]] std::shared_ptr<const ModelInForce> to_beat() const noexcept {
    return active_.made_for_this_machine ? active_.model : nullptr;
  }

 private:
  ModelAuthority(ModelKeeper keeper, bool axes_compensated);
  [[nodiscard]] ModelStanding standing_by_store(protocol::HostTime now,
                                                std::optional<protocol::HostTime> axes_known_at,
                                                std::chrono::nanoseconds patience) const;

  /// The store as it was found on an ordinary thread.
  struct Look {
    StoreStamp stamp;
    std::optional<ActiveModel> active = {};  ///< read, because the stamp was another one
    std::string fault = {};                  ///< why it could not be read
  };
  void begin_to_look(protocol::HostTime now);
  Following conclude_look(Result<Look> look, protocol::HostTime now);
  Following report_look(std::string fault);

  ModelKeeper keeper_;
  bool axes_compensated_;
  std::optional<StoreStamp> seen_;    // of the store as `active_` was read from it
  bool read_again_ = false;           // whatever its stamp
  std::optional<StoreStamp> failed_;  // of the store as the last look could not read it
  ActiveModel active_;
  std::string fault_;
  protocol::HostTime next_repair_{};
  std::uint64_t revision_ = 0;
  std::uint64_t looking_since_ = 0;  // revision_ when the look began
  protocol::HostTime looking_from_{};
  std::future<Result<Look>> looking_;
};

}  // namespace abbe::daemon
