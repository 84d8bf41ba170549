#include "abbe/protocol/usb/setup.hpp"

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::usb {

SetupBytes encode(const Setup& setup) ABBE_RT {
  SetupBytes bytes{};
  ByteWriter out{bytes};
  out.little(setup.request_type);
  out.little(setup.request);
  out.little(setup.value);
  out.little(setup.index);
  out.little(setup.length);
  return bytes;
}

Setup decode_setup(std::span<const std::byte, kSetupSize> bytes) ABBE_RT {
  ByteReader in{bytes};
  Setup setup;
  setup.request_type = in.little<std::uint8_t>();
  setup.request = in.little<std::uint8_t>();
  setup.value = in.little<std::uint16_t>();
  setup.index = in.little<std::uint16_t>();
  setup.length = in.little<std::uint16_t>();
  return setup;
}

}  // namespace abbe::protocol::usb
