#pragma once
/// The kinds of devices that abbed knows. What one kind needs (driver options, driver, thread,
/// rings, raw decoder, health) is in one file of src; device_kinds() lists them. The device set and
/// a replay walk over this list; drivers/docs/adding_a_device.md says what a new kind consists of.

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/counter_card/progress.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/sample_source.hpp"

namespace abbe::daemon {

/// A device that moves and touches by itself. The functions are those of SampleSource.
class MachineMotion {
 public:
  MachineMotion() = default;
  MachineMotion(const MachineMotion&) = delete;
  MachineMotion& operator=(const MachineMotion&) = delete;
  virtual ~MachineMotion() = default;

  virtual void measure(std::span<const drivers::ProbePoint> points) = 0;
  virtual void stop() = 0;
  /// Any thread, takes no lock: stops the motion and ends the session.
  virtual void end() = 0;
  [[nodiscard]] virtual std::optional<std::string> release_awaited() const = 0;
  [[nodiscard]] virtual Result<void> release() = 0;
  [[nodiscard]] virtual std::optional<TipPlace> tip_place() const = 0;
  [[nodiscard]] virtual std::size_t points_left() const = 0;
  [[nodiscard]] virtual Result<std::array<double, 3>> position() const = 0;
};

/// A tracker that carries out orders (find the reflector, go to the home position).
class TrackerOrders {
 public:
  TrackerOrders() = default;
  TrackerOrders(const TrackerOrders&) = delete;
  TrackerOrders& operator=(const TrackerOrders&) = delete;
  virtual ~TrackerOrders() = default;

  [[nodiscard]] virtual drivers::DeviceStatus status() const = 0;
  virtual void order(drivers::TrackerOrder order) = 0;
  [[nodiscard]] virtual std::vector<drivers::TrackerOrderReport> reports() = 0;
};

/// The devices of one kind while they run. Used by one thread; the destructor ends their threads.
class RunningDevices {
 public:
  RunningDevices() = default;
  RunningDevices(const RunningDevices&) = delete;
  RunningDevices& operator=(const RunningDevices&) = delete;
  virtual ~RunningDevices() = default;

  /// Appends what arrived since the last call: of each device the samples before the raw bytes. A
  /// driver delivers the bytes first, so bytes are never drained in a later cycle than the samples
  /// decoded from them; a replay relies on this order.
  virtual void drain(Batch& batch) = 0;
  /// One for each line of health, in the order of the configuration.
  [[nodiscard]] virtual std::vector<const drivers::DeviceThread*> threads() const = 0;
  /// What the system refused in real-time mode `ignore`, and what the driver assumes.
  [[nodiscard]] virtual std::vector<std::string> warnings() const;

  // What few kinds can do; null or nullopt: this one cannot.
  [[nodiscard]] virtual MachineMotion* motion() noexcept { return nullptr; }
  [[nodiscard]] virtual TrackerOrders* orders() noexcept { return nullptr; }
  /// The latest that drain() met after its samples; at most once each.
  [[nodiscard]] virtual std::optional<drivers::CounterCardProgress> take_progress() {
    return std::nullopt;
  }
};

/// Decodes the recorded raw bytes of the devices of one kind, by the same receivers as live.
class RawDecoders {
 public:
  RawDecoders() = default;
  RawDecoders(const RawDecoders&) = delete;
  RawDecoders& operator=(const RawDecoders&) = delete;
  virtual ~RawDecoders() = default;

  /// Appends the samples that the block completes; nothing for a device of another kind.
  virtual void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) = 0;
};

/// The devices of a configuration by name, and which of them delivers what.
struct DeviceNames {
  std::vector<std::string> all;  ///< Batch::raw counts them
  std::string tracker = "tracker", axes = "encoder", touches = "probe";
  std::vector<std::string> environment;  ///< in the order of Config::environment
};
[[nodiscard]] DeviceNames device_names(const Config& config);

/// What devices are started with. `first`: place in DeviceNames::all of the first device of the
/// kind. `left`: how far an earlier run left the counters of the counter
/// card, which then go on if the card did.
struct DeviceStart {
  const Config& config;
  const drivers::TimeSource& time;
  std::size_t first;
  const std::optional<drivers::CounterCardProgress>& left;
};

struct DeviceKind {
  std::string_view table;  ///< of the configuration
  /// Adds the configured devices of this kind.
  void (*name)(const Config& config, DeviceNames& names);
  /// Null: the configuration has no device of this kind.
  Result<std::unique_ptr<RunningDevices>> (*start)(const DeviceStart& start);
  /// Null as start().
  std::unique_ptr<RawDecoders> (*decoders)(const Config& config,
                                           const std::optional<drivers::CounterCardProgress>& left);
};

/// In the order in which health names them.
[[nodiscard]] std::span<const DeviceKind> device_kinds();

}  // namespace abbe::daemon
