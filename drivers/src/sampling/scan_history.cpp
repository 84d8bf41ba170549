#include "abbe/drivers/sampling/scan_history.hpp"

#include <algorithm>
#include <bit>

namespace abbe::drivers {
namespace {

std::size_t rounded(std::size_t capacity) {
  return std::bit_ceil(std::max<std::size_t>(capacity, 8));
}

}  // namespace

ScanHistory::ScanHistory(std::size_t capacity, double clock_hz)
    : slots_(rounded(capacity)), mask_(rounded(capacity) - 1), period_s_(1.0 / clock_hz) {}

}  // namespace abbe::drivers
