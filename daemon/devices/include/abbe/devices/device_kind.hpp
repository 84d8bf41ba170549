#pragma once
/// The kinds of devices that abbed supports. One file of src contains everything for one kind:
/// driver options, driver, thread, rings, raw decoder, health. device_kinds() lists the kinds. The
/// device set and a replay iterate over this list; drivers/docs/adding_a_device.md describes how to
/// add a kind.

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/device_thread.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/counting_progress.hpp"
#include "abbe/pipeline/device_names.hpp"
#include "abbe/pipeline/sample_source.hpp"

namespace abbe::daemon {

/// A device that moves and probes under its own control (a measuring machine). SampleSource has
/// functions of the same names and describes them.
class MachineMotion {
 public:
  MachineMotion() = default;
  MachineMotion(const MachineMotion&) = delete;
  MachineMotion& operator=(const MachineMotion&) = delete;
  virtual ~MachineMotion() = default;

  virtual void measure(std::span<const drivers::ProbePoint> points) = 0;
  /// May be called from any thread; takes no lock.
  virtual std::uint64_t stop() = 0;
  /// May be called from any thread.
  [[nodiscard]] virtual drivers::IppStop last_stop() const = 0;
  /// May be called from any thread; takes no lock. Stops the motion and ends the session.
  virtual void end() = 0;
  /// Same as end(), but waits until the motion is stopped or until it is known that the stop cannot
  /// be confirmed. Ends the device thread. No other function may be called afterwards.
  virtual drivers::IppStop finish() = 0;
  [[nodiscard]] virtual std::optional<std::string> release_awaited() const = 0;
  [[nodiscard]] virtual Result<void> release() = 0;
  [[nodiscard]] virtual std::optional<TipPlace> tip_place() const = 0;
  [[nodiscard]] virtual std::size_t points_left() const = 0;
  [[nodiscard]] virtual Result<std::array<double, 3>> position() const = 0;
};

/// A tracker that carries out orders, for example to find the reflector or to go to the home
/// position.
class TrackerOrders {
 public:
  TrackerOrders() = default;
  TrackerOrders(const TrackerOrders&) = delete;
  TrackerOrders& operator=(const TrackerOrders&) = delete;
  virtual ~TrackerOrders() = default;

  [[nodiscard]] virtual drivers::DeviceStatus status() const = 0;
  virtual void order(drivers::TrackerOrder order) = 0;
  /// Longest host time from an order to the report of its outcome.
  [[nodiscard]] virtual std::chrono::nanoseconds longest_order() const = 0;
  [[nodiscard]] virtual std::vector<drivers::TrackerOrderReport> reports() = 0;
};

/// The running devices of one kind. Used by one thread; the destructor ends the device threads.
class RunningDevices {
 public:
  RunningDevices() = default;
  RunningDevices(const RunningDevices&) = delete;
  RunningDevices& operator=(const RunningDevices&) = delete;
  virtual ~RunningDevices() = default;

  /// Appends the samples and raw bytes that arrived since the last call. For each device the
  /// samples are drained before the raw bytes, while a driver delivers the bytes before the samples
  /// decoded from them. Bytes are therefore never drained in a later cycle than their samples; a
  /// replay relies on this.
  virtual void drain(Batch& batch) = 0;
  /// The device threads, one for each device in the health report, in the order of the
  /// configuration.
  [[nodiscard]] virtual std::vector<const drivers::DeviceThread*> threads() const = 0;
  /// One sentence for each real-time setting that the operating system refused (real-time mode
  /// `ignore`), and for each assumption of the driver.
  [[nodiscard]] virtual std::vector<std::string> warnings() const;

  /// Samples per second that each device sends while its state is "streaming"; 0: not known.
  [[nodiscard]] virtual double nominal_rate_hz() const { return 0.0; }

  // Functions of some kinds only. A result of null or nullopt means that this kind of device does
  // not have the function.
  [[nodiscard]] virtual MachineMotion* motion() noexcept { return nullptr; }
  [[nodiscard]] virtual TrackerOrders* orders() noexcept { return nullptr; }
  /// The latest state of the counters that drain() has read. The samples up to this state are
  /// already in the batch of that drain(). Each state is returned at most once.
  [[nodiscard]] virtual std::optional<CountingProgress> take_progress() { return std::nullopt; }
};

/// Decodes the recorded raw bytes of the devices of one kind, with the receivers that the live
/// devices use.
class RawDecoders {
 public:
  RawDecoders() = default;
  RawDecoders(const RawDecoders&) = delete;
  RawDecoders& operator=(const RawDecoders&) = delete;
  virtual ~RawDecoders() = default;

  /// Appends the samples that are complete with this block. Ignores a block from a device of
  /// another kind.
  virtual void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) = 0;
  /// Call it at the end of the recording: appends the samples that waited for further blocks.
  virtual void finish(Batch& /*batch*/) {}
};

[[nodiscard]] DeviceNames device_names(const Config& config);

/// Arguments of DeviceKind::start. `first`: index in DeviceNames::all of the first device of the
/// kind. `left`: state of the counters when abbed ended last; the driver continues from it if the
/// card has kept counting since.
struct DeviceStart {
  const Config& config;
  const drivers::TimeSource& time;
  std::size_t first;
  const std::optional<CountingProgress>& left;
};

struct DeviceKind {
  /// True if the device moves by itself or on orders: it is started after the devices that only
  /// measure, and ended before them.
  bool moves = false;
  /// Adds the names of the configured devices of this kind to `names`.
  void (*name)(const Config& config, DeviceNames& names);
  /// Starts the devices. Null if the configuration has no device of this kind.
  Result<std::unique_ptr<RunningDevices>> (*start)(const DeviceStart& start);
  /// Creates the decoders of recorded raw bytes. Null if the configuration has no device of this
  /// kind.
  std::unique_ptr<RawDecoders> (*decoders)(const Config& config,
                                           const std::optional<CountingProgress>& left);
};

/// All kinds, in the order of the health report.
[[nodiscard]] std::span<const DeviceKind> device_kinds();

}  // namespace abbe::daemon
