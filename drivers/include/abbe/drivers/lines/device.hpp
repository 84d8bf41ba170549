#pragma once
/// A device whose measurements come as lines of text, as a Device: a receiver of lines behind a
/// LineSession, which has its states. abbe sends nothing: what is measured, and when, is decided by
/// the program that prints the lines. The arrival time is the user-space time at which the read
/// returned.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/lines/link.hpp"
#include "abbe/drivers/lines/receiver.hpp"
#include "abbe/drivers/lines/session.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

template <class Content>
struct LineDeviceOptions {
  std::string name{Content::kWords.device};
  LineAddress address;
  /// datagrams and begins_anywhere are set from `address`.
  LineReceiverOptionsOf<Content> receiver;
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  /// A longer time without a line is a fault.
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};
  std::size_t sample_capacity = 16384;  ///< 32 s at 500 samples per second
  std::size_t raw_capacity_blocks = 4096;
};

/// Options of the receiver of this device; a replay needs the same ones.
template <class Content>
[[nodiscard]] LineReceiverOptionsOf<Content> receiver_options(
    const LineDeviceOptions<Content>& options) {
  LineReceiverOptionsOf<Content> receiver = options.receiver;
  receiver.datagrams = std::holds_alternative<LineUdp>(options.address);
  receiver.begins_anywhere = std::holds_alternative<LineSerial>(options.address);
  return receiver;
}

template <class Content>
class LineDevice final : public Device {
 public:
  using Sample = typename Content::Sample;
  using Options = LineDeviceOptions<Content>;

  /// `time` must outlive the device. Error BadConfiguration: the address or the format is not
  /// valid. The first wait() opens the connection.
  [[nodiscard]] static Result<std::unique_ptr<LineDevice>> create(const Options& options,
                                                                  const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader thread for each ring.
  [[nodiscard]] SampleRing<Sample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return session_.raw(); }
  /// Device thread. Of a TCP server or a datagram socket, once wait() has opened it; else 0.
  [[nodiscard]] std::uint16_t local_port() const noexcept { return session_.local_port(); }

 private:
  LineDevice(const Options& options, const TimeSource& time);

  LineSession session_;
  SampleRing<Sample> samples_;
  LineReceiverOf<Content> receiver_;
};

using LineTrackerOptions = LineDeviceOptions<LinePoints>;
using LineTrackerDevice = LineDevice<LinePoints>;
using LineAxesOptions = LineDeviceOptions<LineAxes>;
using LineAxesDevice = LineDevice<LineAxes>;

}  // namespace abbe::drivers
