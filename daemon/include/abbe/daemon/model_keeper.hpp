#pragma once
/// The slow half of the model authority: puts judged models into the store and reads which one is active,
/// with all the waiting for disk and locks that takes. For any thread but the hub's; a copy for each.
/// Ordinary world.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/calib/gate.hpp"
#include "abbe/daemon/config.hpp"
#include "abbe/daemon/idl_messages.hpp"
#include "abbe/daemon/model_store.hpp"

namespace abbe::daemon {

/// What the store says is active, read and checked. Without a model `fault` says why; both empty: nothing is
/// active.
struct ActiveModel {
  StoreEvent activation;  ///< default: nothing was ever activated
  std::optional<ModelInForce> model;
  bool made_for_this_machine = false;
  std::string fault;
};

/// Said where a candidate is not compared with the active model.
inline constexpr std::string_view kOfAnotherMachine =
    "not compared with the active model: that one was made for another machine configuration";

/// A model that is in the store now.
struct KeptModel {
  std::string id;
  std::optional<ActiveModel> active;  ///< if the gate accepted it
};

class ModelKeeper {
 public:
  [[nodiscard]] static Result<ModelKeeper> open(const std::filesystem::path& store_folder,
                                                const Config& config, protocol::UtcOffset utc);

  /// Keeps a judged model, activates it if the gate accepted it, and reads it back.
  [[nodiscard]] Result<KeptModel> keep(const ModelDocument& document, const calib::Verdict& verdict,
                                       const StoreActor& actor, protocol::HostTime now);
  /// An error only if the store itself cannot be read; a damaged model is a `fault`.
  [[nodiscard]] Result<ActiveModel> read_active(protocol::HostTime now) const;
  /// Whether read_active() may say something else than when this was the same. One system call.
  [[nodiscard]] StoreStamp stamp() const noexcept { return store_.stamp(); }

 private:
  ModelKeeper(ModelStore store, std::string machine_hash, protocol::UtcOffset utc)
      : store_(std::move(store)), machine_hash_(std::move(machine_hash)), utc_(utc) {}

  ModelStore store_;
  std::string machine_hash_;
  protocol::UtcOffset utc_;
};

}  // namespace abbe::daemon
