#pragma once
/// Which model is in force, and what may be said of it. The store is the memory; this is its one writer in a
/// running daemon; when and by whom a model was activated is the store's to say, so that a restart changes
/// neither its age nor its reason. After a restart the active model is STALE until the machine's
/// configuration hash agrees with the one the model was made for and all axes have been seen; without recent
/// axis positions it is STALE again. Where the control corrects the axis readings itself it is INVALID:
/// applied, it would correct twice. Ordinary world; used by the hub's thread only.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "abbe/calib/gate.hpp"
#include "abbe/daemon/config.hpp"
#include "abbe/daemon/model_store.hpp"
#include "abbe/daemon/publisher.hpp"

namespace abbe::daemon {

class ModelAuthority {
 public:
  /// Takes up the active model of the store, if there is one. A damaged one is said in standing() and not
  /// used.
  [[nodiscard]] static Result<ModelAuthority> open(const std::filesystem::path& store_folder,
                                                   const Config& config, protocol::UtcOffset utc,
                                                   protocol::HostTime now);

  /// Keeps a judged model and activates it if the gate accepted it. Returns its id.
  [[nodiscard]] Result<std::string> add(const ModelDocument& document, const calib::Verdict& verdict,
                                        const StoreActor& actor, protocol::HostTime now);
  /// Takes up another model if somebody has activated or rolled back one in the store (`abbe model ...`
  /// does). True if it changed.
  bool follow_store(protocol::HostTime now);

  /// `axes_known_at`: the latest instant all axes were known; `patience`: how long that may be ago.
  [[nodiscard]] ModelStanding standing(protocol::HostTime now,
                                       std::optional<protocol::HostTime> axes_known_at,
                                       std::chrono::nanoseconds patience) const;
  [[nodiscard]] const ModelInForce* in_force() const noexcept { return in_force_ ? &*in_force_ : nullptr; }
  [[nodiscard]] const ModelStore& store() const noexcept { return store_; }

 private:
  ModelAuthority(ModelStore store, const Config& config, protocol::UtcOffset utc);
  [[nodiscard]] Result<void> take_up_active(protocol::HostTime now);

  ModelStore store_;
  std::string machine_hash_;
  bool axes_compensated_;
  protocol::UtcOffset utc_;
  StoreEvent activation_;  // of the store's active model, in force or not
  std::optional<ModelInForce> in_force_;
  bool made_for_this_machine_ = false;
  std::string fault_;  // why the store's active model is not in force
  std::uint64_t revision_ = 0;
};

}  // namespace abbe::daemon
