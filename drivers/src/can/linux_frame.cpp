#include "abbe/drivers/can/linux_frame.hpp"

#include <algorithm>
#include <cstring>

namespace abbe::drivers {

std::optional<can::CanFrame> from_linux(const canfd_frame& frame, std::size_t size) noexcept {
  if (size != CAN_MTU && size != CANFD_MTU) return std::nullopt;
  const bool fd = size == CANFD_MTU;
  const std::size_t longest = fd ? can::CanFrame::kMaxData : can::CanFrame::kMaxClassicData;
  can::CanFrame out;
  if ((frame.can_id & CAN_EFF_FLAG) != 0) out.set(can::FrameFlag::Extended);
  if ((frame.can_id & CAN_RTR_FLAG) != 0) out.set(can::FrameFlag::Remote);
  if ((frame.can_id & CAN_ERR_FLAG) != 0) out.set(can::FrameFlag::Error);
  const bool wide = out.is(can::FrameFlag::Extended) || out.is(can::FrameFlag::Error);
  out.id = frame.can_id & (wide ? CAN_EFF_MASK : CAN_SFF_MASK);

  if (fd) {
    out.set(can::FrameFlag::Fd);
    out.fd_flags = frame.flags & (CANFD_BRS | CANFD_ESI);
  }

  out.length = static_cast<std::uint8_t>(std::min<std::size_t>(frame.len, longest));
  std::memcpy(out.data.data(), frame.data, out.payload().size());
  return out;
}

LinuxFrame to_linux(const can::CanFrame& frame) noexcept {
  LinuxFrame out;
  const bool fd = frame.is(can::FrameFlag::Fd);
  out.size = fd ? CANFD_MTU : CAN_MTU;
  out.frame.can_id = frame.id & CAN_EFF_MASK;
  if (frame.is(can::FrameFlag::Extended)) out.frame.can_id |= CAN_EFF_FLAG;
  if (frame.is(can::FrameFlag::Remote)) out.frame.can_id |= CAN_RTR_FLAG;
  if (frame.is(can::FrameFlag::Error)) out.frame.can_id |= CAN_ERR_FLAG;
  const std::size_t longest = fd ? can::CanFrame::kMaxData : can::CanFrame::kMaxClassicData;
  out.frame.len = static_cast<std::uint8_t>(std::min<std::size_t>(frame.length, longest));
  out.frame.flags = fd ? frame.fd_flags : std::uint8_t{0};
  std::memcpy(out.frame.data, frame.data.data(), std::min(longest, frame.payload().size()));
  return out;
}

std::vector<can_filter> filters_for(std::span<const std::uint32_t> ids) {
  std::vector<can_filter> filters;
  filters.reserve(ids.size());
  for (const auto id : ids) {
    filters.push_back({id & CAN_SFF_MASK, CAN_EFF_FLAG | CAN_RTR_FLAG | CAN_SFF_MASK});
  }
  return filters;
}

}  // namespace abbe::drivers
