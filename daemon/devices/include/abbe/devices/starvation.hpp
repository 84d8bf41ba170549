#pragma once
/// Detects a stream that delivers fewer samples than its device sends. Not thread-safe.

#include <array>
#include <cstdint>
#include <string>

#include "abbe/protocol/time.hpp"

namespace abbe::daemon {

class Starvation {
 public:
  /// Call it about once a second with the number of samples so far. `nominal_hz`: samples per
  /// second that the device sends; 0: not known. `streaming`: the device sends now. Streams with
  /// fewer than 20 samples per second are not checked. Returns a text if samples are missing, "47 %
  /// of the 100 samples per second arrive: ..."; empty if enough arrive.
  [[nodiscard]] std::string look(double nominal_hz, bool streaming, protocol::HostTime now,
                                 std::uint64_t samples);

 private:
  struct Count {
    protocol::HostTime at{};
    std::uint64_t samples = 0;
    bool known = false;  ///< the device was streaming at this count
  };
  std::array<Count, 2> earlier_{};  ///< the last count but one, then the last count
};

}  // namespace abbe::daemon
