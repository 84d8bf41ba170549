#pragma once
/// Replays a counter card from a recording.
///   - While no scan runs, a request gets the answer to the next equal request of the recorded
///     connection. If the recorded card did not answer, the replay does not answer either.
///   - A scan has its original timing, counted from the start of the pacer (scan timer).
///     During a scan the status is the recorded status of that time.
///   - A connection that broke in the recording breaks again. The next connection replays the next
///     recorded one; after the last one the replay begins again with the first.
///   - A host that halts a scan earlier than in the recording and restarts it gets the rest of the
///     recorded scan.
/// Not thread-safe.
///
/// A recording does not contain the card's descriptors: the replay has those of the simulated card,
/// with the given serial number.

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/protocol/usbip/urb.hpp"
#include "abbe/sim/counter_card.hpp"
#include "abbe/sim/exported_card.hpp"
#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

class RecordedCard final : public ExportedCard {
 public:
  /// `timeline` must outlive the card. `leads`: this device starts the timeline, because the
  /// recording has no tracker.
  RecordedCard(const RecordedDevice& device, const std::string& serial, ReplayTimeline& timeline,
               bool leads);

  [[nodiscard]] UsbIds ids() const override;
  [[nodiscard]] ControlAnswer answer(const protocol::usb::Setup& setup, HostTime now) override;
  void advance(HostTime now, std::size_t wanted) override;
  [[nodiscard]] std::vector<std::byte> take(std::size_t most) override;
  [[nodiscard]] std::size_t available() const override { return fifo_.size(); }
  [[nodiscard]] HostTime available_at(std::size_t bytes) const override;
  [[nodiscard]] bool scanning() const override;
  void host_disconnected() override;
  [[nodiscard]] HostTime breaks_at() const override;

  /// True if every recorded scan has been sent.
  [[nodiscard]] bool finished() const { return finished_; }
  [[nodiscard]] std::size_t transfers() const;

 private:
  struct Exchange {
    protocol::usb::Setup setup;
    HostTime asked{};
    std::optional<ControlAnswer> answer;  ///< nullopt: the card did not answer
  };
  struct Transfer {
    HostTime time{};
    std::vector<std::byte> bytes;
  };
  /// The scans from one start of the pacer to the next.
  struct Scan {
    std::size_t begins = 0;  ///< index of the exchange that started it
    std::size_t halts = 0;   ///< the next exchange that is not a status request
    std::vector<Transfer> transfers;
  };
  struct Connection {
    std::size_t begins = 0;  ///< index of its first exchange
    std::optional<HostTime> lost;
  };

  void read(const RecordedBlock& block);
  void read_message(std::span<const std::byte> message, HostTime time, bool to_device);
  void read_request(const protocol::usb::Setup& setup, HostTime time);
  void find_halts();
  [[nodiscard]] std::size_t end_of_connection() const;
  [[nodiscard]] ControlAnswer status_at(HostTime recorded) const;
  [[nodiscard]] ControlAnswer next_answer(const protocol::usb::Setup& setup, HostTime now);
  [[nodiscard]] ControlAnswer unrecorded(const protocol::usb::Setup& setup, HostTime now);
  [[nodiscard]] std::optional<std::size_t> find(const protocol::usb::Setup& setup) const;
  void open();
  void start(std::size_t scan, HostTime now);
  [[nodiscard]] bool has_rest() const;
  [[nodiscard]] bool halts_early(HostTime now) const;
  [[nodiscard]] HostTime due(HostTime recorded) const;
  [[nodiscard]] HostTime recorded(HostTime now) const;

  ReplayTimeline& timeline_;
  bool leads_;
  CounterCard descriptors_;
  std::vector<Exchange> exchanges_;
  std::vector<Scan> scans_;
  std::vector<Connection> connections_;
  /// used while the recording is read: number of version requests on this connection
  unsigned versions_ = 0;

  bool opened_ = false;   ///< the present host has opened the card
  std::size_t next_ = 0;  ///< index of the next exchange
  std::optional<std::size_t> connection_;
  std::optional<std::size_t> scan_;
  std::size_t next_transfer_ = 0;
  bool running_ = false;   ///< the pacer runs for the present host
  bool flushing_ = false;  ///< the host halts the scan: the rest of the scan is sent at once
  bool resuming_ = false;  ///< the host restarts a scan that continued in the recording
  std::chrono::nanoseconds shift_{};
  std::deque<std::byte> fifo_;
  bool finished_ = false;
};

}  // namespace abbe::sim
