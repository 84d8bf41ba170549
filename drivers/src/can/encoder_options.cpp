#include <fmt/format.h>

#include <cmath>

#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/result/try.hpp"

namespace abbe::drivers {

namespace {

Result<void> refuse(std::string text) {
  return tl::unexpected(Error{ErrorCode::BadConfiguration, std::move(text)});
}

Result<void> check_axis(const EncoderAxis& axis) {
  const auto name = fmt::format("encoder axis {} (node {})", axis.name, axis.node);
  if (!can::is_node_id(axis.node)) return refuse(name + ": node must be 1 to 127");
  if (axis.tpdo != 1 && axis.tpdo != 2) return refuse(name + ": TPDO must be 1 or 2");
  if (axis.scale && (*axis.scale == 0.0 || !std::isfinite(*axis.scale))) {
    return refuse(fmt::format("{}: scale {} per count is not possible", name, *axis.scale));
  }
  if (axis.wrap_counts == 1 || axis.wrap_counts >> 62 != 0) {
    return refuse(fmt::format("{}: wrap_counts {}: 2 to 2^62 - 1 are possible, or 0", name,
                              axis.wrap_counts));
  }
  return {};
}

}  // namespace

Result<void> check(const EncoderReceiverOptions& options) {
  if (options.axes.empty() || options.axes.size() > protocol::kMaxAxes) {
    return refuse(fmt::format("encoder bus: {} axes, 1 to {} are possible", options.axes.size(),
                              protocol::kMaxAxes));
  }

  if (options.sync_period.count() <= 0)
    return refuse("encoder bus: the SYNC period must be positive");
  if (options.answer_within > options.sync_period || options.answer_within.count() < 0) {
    return refuse("encoder bus: the time for answers must be 0 to one SYNC period");
  }

  if (options.u_sampling_delay.count() < 0)
    return refuse("encoder bus: the uncertainty of the sampling delay must not be negative");
  for (std::size_t i = 0; i < options.axes.size(); ++i) {
    ABBE_TRY(check_axis(options.axes[i]));
    for (std::size_t j = 0; j < i; ++j) {
      if (options.axes[i].node != options.axes[j].node) continue;
      return refuse(fmt::format("encoder axes {} and {}: both are node {}", options.axes[j].name,
                                options.axes[i].name, options.axes[i].node));
    }
  }

  return {};
}

std::chrono::nanoseconds answer_within(const EncoderReceiverOptions& options) {
  return options.answer_within.count() > 0 ? options.answer_within : options.sync_period * 4 / 5;
}

}  // namespace abbe::drivers
