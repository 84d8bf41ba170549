#include <fmt/format.h>

#include "abbe/drivers/usb/usb_link.hpp"

namespace abbe::drivers {

std::string wrong_ids(const UsbIdentity& wanted, std::uint16_t vendor, std::uint16_t product) {
  if (vendor == wanted.vendor && product == wanted.product) return {};
  return fmt::format("it is {:04X}:{:04X}, configured is {:04X}:{:04X}", vendor, product,
                     wanted.vendor, wanted.product);
}

std::string wrong_serial(const UsbIdentity& wanted, std::string_view serial) {
  if (wanted.serial.empty() || serial == wanted.serial) return {};
  return fmt::format("its serial number is \"{}\", configured is \"{}\"", serial, wanted.serial);
}

}  // namespace abbe::drivers
