#pragma once
/// Encoder nodes on a CAN interface, in the test's own thread.

#include "can_interface.hpp"
#include "encoder_nodes.hpp"

namespace abbe::tests {

class VcanNodes : public EncoderNodes {
 public:
  VcanNodes(const CanInterface& interface, std::span<const can::EncoderIdentity> identities)
      : EncoderNodes(identities), socket_(interface) {}

  /// Reads what came; answers SDO and NMT, beats. A SYNC is only remembered: see answer_sync().
  void serve(HostTime now) {
    while (const auto frame = socket_.receive()) on_frame(*frame, now);
    beat(now);
  }
  /// Discards everything received: the cable was unplugged.
  void drain() {
    while (socket_.receive()) {
    }
    forget_sync();
  }
  void send(std::span<const can::CanFrame> frames) override { (void)socket_.send(frames); }
  [[nodiscard]] const CanSocket& socket() const { return socket_; }

 private:
  CanSocket socket_;
};

}  // namespace abbe::tests
