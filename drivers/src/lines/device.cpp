#include "abbe/drivers/lines/device.hpp"

#include <fmt/format.h>

#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

template <class Content>
LineSessionOptions session_options(const LineDeviceOptions<Content>& options) {
  return {.name = options.name,
          .address = options.address,
          .connect_timeout = options.connect_timeout,
          .silence_timeout = options.silence_timeout,
          .raw_capacity_blocks = options.raw_capacity_blocks};
}

template <class Content>
LineTexts line_texts(const LineReceiverOptionsOf<Content>& options) {
  LineTexts texts{.words = Content::kWords,
                  .columns = {},
                  .time_separation = options.time_separation,
                  .max_skew = options.clock.max_skew};
  for (std::size_t i = 0; i < options.format.column_count; ++i)
    texts.columns.emplace_back(lines::column_name(options.format, i));
  return texts;
}

}  // namespace

template <class Content>
Result<std::unique_ptr<LineDevice<Content>>> LineDevice<Content>::create(const Options& options,
                                                                         const TimeSource& time) {
  const auto refused = [&](std::string_view what) {
    return tl::unexpected{
        Error{ErrorCode::BadConfiguration, fmt::format("{}: {}", options.name, what)}};
  };
  if (const auto valid = check(options.address); !valid) return refused(valid.error().text);
  if (const auto what = lines::format_fault(options.receiver.format); !what.empty())
    return refused(fmt::format("the format of the lines {}", what));
  return std::unique_ptr<LineDevice>{new LineDevice{options, time}};
}

template <class Content>
LineDevice<Content>::LineDevice(const Options& options, const TimeSource& time)
    : session_(session_options(options), line_texts(options.receiver), time),
      samples_(options.sample_capacity),
      receiver_(receiver_options(options)) {}

template <class Content>
void LineDevice<Content>::wait(std::chrono::nanoseconds at_most) {
  session_.report(receiver_.findings());
  session_.wait(at_most);
}

template <class Content>
DeviceStatus LineDevice<Content>::status() const {
  return session_.status(samples_.dropped());
}

template class LineDevice<LinePoints>;
template class LineDevice<LineAxes>;

}  // namespace abbe::drivers
