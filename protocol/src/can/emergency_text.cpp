#include <algorithm>
#include <array>

#include "abbe/protocol/can/canopen.hpp"

namespace abbe::protocol::can {

namespace {

struct EmergencyClass {
  std::uint16_t code;
  std::uint16_t mask;
  const char* text;
};

/// Emergency error code classes [CiA 301, EMCY]; specific classes before general ones.
constexpr std::array kClasses{
    EmergencyClass{0x0000, 0xFF00, "error reset"},
    EmergencyClass{0x1000, 0xFF00, "generic error"},
    EmergencyClass{0x2100, 0xFF00, "current, device input side"},
    EmergencyClass{0x2200, 0xFF00, "current inside the device"},
    EmergencyClass{0x2300, 0xFF00, "current, device output side"},
    EmergencyClass{0x2000, 0xF000, "current"},
    EmergencyClass{0x3100, 0xFF00, "mains voltage"},
    EmergencyClass{0x3200, 0xFF00, "voltage inside the device"},
    EmergencyClass{0x3300, 0xFF00, "output voltage"},
    EmergencyClass{0x3000, 0xF000, "voltage"},
    EmergencyClass{0x4100, 0xFF00, "ambient temperature"},
    EmergencyClass{0x4200, 0xFF00, "device temperature"},
    EmergencyClass{0x4000, 0xF000, "temperature"},
    EmergencyClass{0x5000, 0xF000, "device hardware"},
    EmergencyClass{0x6100, 0xFF00, "internal software"},
    EmergencyClass{0x6200, 0xFF00, "user software"},
    EmergencyClass{0x6300, 0xFF00, "data set"},
    EmergencyClass{0x6000, 0xF000, "device software"},
    EmergencyClass{0x7000, 0xF000, "additional modules"},
    EmergencyClass{0x8110, 0xFFFF, "communication: CAN overrun"},
    EmergencyClass{0x8120, 0xFFFF, "communication: CAN in error passive mode"},
    EmergencyClass{0x8130, 0xFFFF, "communication: life guard or heartbeat error"},
    EmergencyClass{0x8140, 0xFFFF, "communication: recovered from bus-off"},
    EmergencyClass{0x8150, 0xFFFF, "communication: CAN-ID collision"},
    EmergencyClass{0x8100, 0xFF00, "communication"},
    EmergencyClass{0x8210, 0xFFFF, "protocol: PDO too short, not processed"},
    EmergencyClass{0x8220, 0xFFFF, "protocol: PDO too long"},
    EmergencyClass{0x8200, 0xFF00, "protocol error"},
    EmergencyClass{0x8000, 0xF000, "monitoring"},
    EmergencyClass{0x9000, 0xF000, "external error"},
    EmergencyClass{0xF000, 0xFF00, "additional functions"},
    EmergencyClass{0xFF00, 0xFF00, "device specific"},
};

}  // namespace

const char* emergency_text(std::uint16_t code) noexcept {
  const auto found = std::find_if(kClasses.begin(), kClasses.end(),
                                  [code](const auto& c) { return (code & c.mask) == c.code; });
  return found == kClasses.end() ? "code reserved by CiA 301" : found->text;
}

}  // namespace abbe::protocol::can
