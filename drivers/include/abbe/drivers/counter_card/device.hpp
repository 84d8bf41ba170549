#pragma once
/// A USB-QUAD08 counter card as a Device: CounterCardReceiver and CounterCardSession around one USB
/// link. wait() sends the requests of the session and collects the card's answers; receive()
/// converts bytes to scans and raw blocks. States: those of CardState. After a lost connection the
/// counts continue if the card's clock channel shows that the counters ran on meanwhile. After a
/// loss of power the counters restart at zero at the present axis positions
/// (SampleFlag::Restarted): the axes must be referenced again.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "abbe/drivers/counter_card/decimation.hpp"
#include "abbe/drivers/counter_card/receiver.hpp"
#include "abbe/drivers/counter_card/session.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"
#include "abbe/protocol/usbip/urb.hpp"

namespace abbe::drivers {

struct CounterCardOptions {
  std::string name = "counter card";
  std::string serial;  ///< empty: exactly one card must be connected
  CounterCardReceiverOptions receiver;
  CounterCardSessionOptions session;  ///< `peer`, `wiring` and `stream` are set by create()
  /// Duration of the scans in one transfer. It is the resolution of arrival times, and the time
  /// that is lost if a transfer fails.
  std::chrono::nanoseconds transfer_time = std::chrono::microseconds{1500};
  std::size_t transfers_in_flight = 32;
  /// Decimation: every n-th scan becomes a sample in the ring; the sink receives every scan.
  std::size_t sample_every = 1;
  std::size_t sample_capacity = 65536;  ///< 2 s at 33 kHz
  std::size_t raw_capacity_blocks = 4096;
};

/// USB identity of the card that the link must open.
[[nodiscard]] UsbIdentity identity_of(const CounterCardOptions& options);
/// Size of one transfer in bytes: whole packets, at most 16 KiB.
[[nodiscard]] std::size_t transfer_bytes(const CounterCardOptions& options);

class CounterCardDevice final : public Device {
 public:
  /// `time` and `sink` (may be null) must outlive the device. Error BadConfiguration: as check().
  /// The first wait() opens the link.
  [[nodiscard]] static Result<std::unique_ptr<CounterCardDevice>> create(
      const CounterCardOptions& options, std::unique_ptr<UsbLink> link, const TimeSource& time,
      CounterScanSink* sink = nullptr);

  /// Stops a running scan; gives up if the card does not answer a request within about 100 ms.
  ~CounterCardDevice() override;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// Each ring has one reader. A card that latches all its axes on their index delivers no samples.
  [[nodiscard]] SampleRing<protocol::AxisSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// The progress of the counters: one entry a second while the clock model is settled, written
  /// after the sample of the same scan. One reader.
  [[nodiscard]] SampleRing<CounterCardProgress>& progress() noexcept { return progress_ring_; }
  /// The receiver. To be used by the device thread only.
  [[nodiscard]] const CounterCardReceiver& receiver() const noexcept { return receiver_; }
  /// A sentence that names the assumption about latched counters (wiring.hpp), if the configuration
  /// relies on it without `latch_verified`; else empty.
  [[nodiscard]] std::string assumption() const;

 private:
  static constexpr std::size_t kProgressCapacity = 16;

  CounterCardDevice(const CounterCardOptions& options, std::unique_ptr<UsbLink> link,
                    const TimeSource& time, CounterScanSink* sink);

  void step_session(const CardInput& input);
  [[nodiscard]] bool act(const CardAction& action);
  void send(const usb::Setup& setup);
  void stop_scan();
  [[nodiscard]] bool answered();
  void hand_over_events();
  void hand_over_scans();
  void account();
  void report_clock();
  void show();

  void take(const UsbControlDone& done) ABBE_RT;
  void take(const UsbBulkIn& bulk) ABBE_RT;
  void push(const CounterScan& scan) ABBE_RT;
  void note_progress(const CounterScan& scan) ABBE_RT;
  void record(const protocol::usbip::SubmitReply& reply, std::span<const std::byte> data,
              protocol::HostTime time) ABBE_RT;

  CounterCardOptions options_;
  std::unique_ptr<UsbLink> link_;
  const TimeSource& time_;
  CounterScanSink* sink_;
  bool live_axes_ = true;
  ScanDecimation decimation_;
  SampleRing<protocol::AxisSample> samples_;
  RawRing raw_;
  SampleRing<CounterCardProgress> progress_ring_{kProgressCapacity};
  StatusBoard board_;
  CounterCardReceiver receiver_;
  CounterCardSession session_;

  /// events of the latest wait(), for the session in the next wait()
  std::span<const UsbEvent> events_;
  protocol::HostTime cycle_end_{};
  protocol::HostTime read_until_{};  ///< the latest wait() read all earlier events
  std::size_t scans_ = 0;            ///< number of scans in the latest receive()
  bool out_of_step_reported_ = false;
  std::uint64_t faults_seen_ = 0;
  std::uint64_t gaps_seen_ = 0;
  std::uint64_t disagreements_seen_ = 0;
  std::uint64_t restarts_seen_ = 0;
  std::uint64_t withheld_seen_ = 0;
  bool clock_reported_ = false;   ///< a rate error beyond the limit was reported
  CounterCardProgress progress_;  ///< the latest state
  std::uint32_t raw_sequence_ = 0;

  std::array<std::byte, CounterCardReceiver::kLongestMessage> message_{};
};

}  // namespace abbe::drivers
