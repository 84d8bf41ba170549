#pragma once
/// Writes the state of a measuring machine to its file, on a thread of its own: the device thread,
/// which sends AbortE, never waits for the disk. Only the latest state is written. A failed write
/// is repeated every kRetryPeriod. keep() and stored() take no lock; one thread calls them.

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "abbe/base/end_limits.hpp"
#include "abbe/drivers/ippdme/device.hpp"

namespace abbe::daemon {

class MachineHoldWriter {
 public:
  static constexpr std::chrono::seconds kRetryPeriod{1};
  static constexpr std::chrono::seconds kEndTimeout = kLongestHoldEnd;

  /// `in_file`: the state in the file; nullopt: not known, so that the first state is written.
  MachineHoldWriter(std::filesystem::path file, std::optional<drivers::IppMachine> in_file);
  /// Waits until the latest state is written, or cannot be, at most kEndTimeout. A state that is
  /// not written by then is reported on stderr.
  ~MachineHoldWriter();
  MachineHoldWriter(const MachineHoldWriter&) = delete;
  MachineHoldWriter& operator=(const MachineHoldWriter&) = delete;

  /// Writes the state soon.
  void keep(const drivers::IppMachine& machine);
  /// Whether the latest state of keep() is in the file.
  [[nodiscard]] drivers::IppStored stored() const;

 private:
  struct Work;
  std::shared_ptr<Work> work_;  // shared with the thread, which a stalled disk may keep longer
  std::thread thread_;
};

}  // namespace abbe::daemon
