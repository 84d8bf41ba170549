#pragma once
/// The identity of the machine as the hub uses it. It is read at the start and then every second on
/// an ordinary thread, because `abbe machine identity` changes its file. No model is ACTIVE while
/// the identity is not confirmed, or while the active model belongs to the machine before `abbe
/// machine identity new`. Used by the hub's thread.

#include <chrono>
#include <filesystem>
#include <future>
#include <string>
#include <vector>

#include "abbe/model/machine_identity.hpp"
#include "abbe/pipeline/stream_health.hpp"
#include "abbe/publishing/publisher.hpp"

namespace abbe::daemon {

class IdentityWatch {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::seconds kPeriod{1};

  struct Known {
    std::string machine_id;  ///< empty: the identity could neither be read nor made
    std::string doubt;  ///< reason why no model may be ACTIVE; empty: the identity is confirmed
    std::string fault;  ///< reason why the identity could not be read or made
    std::vector<std::string> others{};  ///< models_of_other_machine()
  };

  /// Reads or makes the identity. Waits for the disk.
  [[nodiscard]] static IdentityWatch open(const std::filesystem::path& data_dir,
                                          const ComputerMarks& here, protocol::UtcTime now);

  /// Call it in every cycle; never waits.
  void follow(WallTime now);

  [[nodiscard]] const Known& known() const noexcept { return known_; }
  /// The reason why model `id` may be used neither for correction nor to judge a run; empty: it may
  /// be used.
  [[nodiscard]] std::string objection_to(const std::string& id) const;
  /// Changes the status from ACTIVE or DRIFT to STALE if the identity does not allow it.
  void restrict(ActiveModelState& state) const;
  /// Health of stream "identity". `twin`: text of abbe-dds about another publisher with this
  /// identity; empty: none.
  [[nodiscard]] StreamHealth health(const std::string& twin) const;

 private:
  IdentityWatch(std::filesystem::path data_dir, ComputerMarks here)
      : data_dir_(std::move(data_dir)), here_(std::move(here)) {}

  std::filesystem::path data_dir_;
  ComputerMarks here_;
  Known known_;
  WallTime next_{};
  std::future<Known> reading_;
};

}  // namespace abbe::daemon
