#pragma once
/// Writes the state of a measuring machine to its file on a separate thread, so that the device
/// thread, which sends AbortE, never waits for the disk. Only the latest state is written. A failed
/// write is repeated every kRetryPeriod. keep() and stored() take no lock; one thread calls them.

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
  /// Waits, at most kEndTimeout, until the latest state is written or cannot be written. A state
  /// that is not written by then is reported on stderr.
  ~MachineHoldWriter();
  MachineHoldWriter(const MachineHoldWriter&) = delete;
  MachineHoldWriter& operator=(const MachineHoldWriter&) = delete;

  /// Requests that the state is written. Does not wait.
  void keep(const drivers::IppMachine& machine);
  /// States whether the latest state passed to keep() is in the file.
  [[nodiscard]] drivers::IppStored stored() const;

 private:
  struct Work;
  // shared with the thread, which a stalled disk may block for longer than this object exists
  std::shared_ptr<Work> work_;
  std::thread thread_;
};

}  // namespace abbe::daemon
