#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "abbe/recording/recording_reader.hpp"
#include "bindings.hpp"
#include "raise.hpp"

namespace py = pybind11;

namespace abbe::python {
namespace {

using daemon::RecordingReader;

template <class T>
py::array column(const std::vector<T>& values) {
  return py::array_t<T>(static_cast<py::ssize_t>(values.size()), values.data());
}

/// An array with `width` numbers in each row.
template <class T>
py::array table(const std::vector<T>& values, std::size_t width) {
  const auto rows = width == 0 ? 0 : values.size() / width;
  return py::array_t<T>({static_cast<py::ssize_t>(rows), static_cast<py::ssize_t>(width)},
                        values.data());
}

/// The columns that all kinds of samples have.
struct HeadColumns {
  std::vector<std::int64_t> time_ns, u_time_ns;
  std::vector<std::uint32_t> flags, lost_before;

  void add(const protocol::SampleHead& head) {
    time_ns.push_back(head.time.time_since_epoch().count());
    u_time_ns.push_back(head.u_time.count());
    flags.push_back(head.flags);
    lost_before.push_back(head.lost_before);
  }
  [[nodiscard]] py::dict columns() const {
    py::dict out;
    out["time_ns"] = column(time_ns);
    out["u_time_ns"] = column(u_time_ns);
    out["flags"] = column(flags);
    out["lost_before"] = column(lost_before);
    return out;
  }
};

struct TrackerColumns {
  HeadColumns head;
  std::vector<std::int64_t> device_time_ns;
  std::vector<std::int32_t> device_status;
  std::vector<double> p_tracker_m;

  void add(const protocol::TrackerPoint& point) {
    head.add(point.head);
    device_time_ns.push_back(point.device_time.time_since_epoch().count());
    device_status.push_back(point.device_status);
    p_tracker_m.insert(p_tracker_m.end(), point.p_tracker_m.begin(), point.p_tracker_m.end());
  }
  [[nodiscard]] py::dict columns() const {
    py::dict out = head.columns();
    out["device_time_ns"] = column(device_time_ns);
    out["device_status"] = column(device_status);
    out["p_tracker_m"] = table(p_tracker_m, 3);
    return out;
  }
};

struct AxisColumns {
  HeadColumns head;
  std::size_t axes = 0;
  std::vector<std::uint32_t> cycle;
  std::vector<std::uint8_t> missing_mask;
  std::vector<std::int64_t> count;
  std::vector<double> position;

  void add(const protocol::AxisSample& sample) {
    if (axes == 0) axes = sample.axis_count;
    if (sample.axis_count != axes) return;  // for one device the number of axes does not change
    head.add(sample.head);
    cycle.push_back(sample.cycle);
    missing_mask.push_back(sample.missing_mask);
    const auto n = static_cast<std::ptrdiff_t>(axes);
    count.insert(count.end(), sample.count.begin(), sample.count.begin() + n);
    position.insert(position.end(), sample.position.begin(), sample.position.begin() + n);
  }
  [[nodiscard]] py::dict columns() const {
    py::dict out = head.columns();
    out["cycle"] = column(cycle);
    out["missing_mask"] = column(missing_mask);
    out["count"] = table(count, axes);
    out["position"] = table(position, axes);
    return out;
  }
};

struct EnvironmentColumns {
  HeadColumns head;
  std::vector<double> air_temperature_K, air_pressure_Pa, relative_humidity, temperature_K;

  void add(const protocol::EnvironmentSample& sample) {
    head.add(sample.head);
    air_temperature_K.push_back(sample.air_temperature_K);
    air_pressure_Pa.push_back(sample.air_pressure_Pa);
    relative_humidity.push_back(sample.relative_humidity);
    temperature_K.insert(temperature_K.end(), sample.temperature_K.begin(),
                         sample.temperature_K.end());
  }
  [[nodiscard]] py::dict columns() const {
    py::dict out = head.columns();
    out["air_temperature_K"] = column(air_temperature_K);
    out["air_pressure_Pa"] = column(air_pressure_Pa);
    out["relative_humidity"] = column(relative_humidity);
    out["temperature_K"] = table(temperature_K, protocol::kNoTemperatures.size());
    return out;
  }
};

struct TouchColumns {
  HeadColumns head;
  std::size_t axes = 0;
  std::vector<std::uint32_t> touch;
  std::vector<double> position;

  void add(const protocol::ProbeTrigger& trigger) {
    if (axes == 0) axes = trigger.axis_count;
    if (trigger.axis_count != axes) return;
    head.add(trigger.head);
    touch.push_back(trigger.touch);
    position.insert(position.end(), trigger.position.begin(),
                    trigger.position.begin() + static_cast<std::ptrdiff_t>(axes));
  }
  [[nodiscard]] py::dict columns() const {
    py::dict out = head.columns();
    out["touch"] = column(touch);
    out["position"] = table(position, axes);
    return out;
  }
};

template <class Columns>
using ByDevice = std::map<std::string, Columns>;

template <class Columns>
py::dict as_dict(const ByDevice<Columns>& devices) {
  py::dict out;
  for (const auto& [name, columns] : devices) out[py::str(name)] = columns.columns();
  return out;
}

/// Returns {"tracker": {DEVICE: columns}, "axes": ..., "environment": ..., "touches": ...}.
py::dict streams(const RecordingReader& reader) {
  ByDevice<TrackerColumns> tracker;
  ByDevice<AxisColumns> axes;
  ByDevice<EnvironmentColumns> environment;
  ByDevice<TouchColumns> touches;
  daemon::RecordingSink sink;
  sink.tracker_point = [&](const auto& s, auto device) { tracker[std::string{device}].add(s); };
  sink.axis_sample = [&](const auto& s, auto device) { axes[std::string{device}].add(s); };
  sink.environment = [&](const auto& s, auto device) { environment[std::string{device}].add(s); };
  sink.probe_trigger = [&](const auto& s, auto device) { touches[std::string{device}].add(s); };
  {
    const py::gil_scoped_release other_threads_may_run;
    (void)reader.read(sink);
  }
  if (auto intact = reader.intact(); !intact) throw Raised(std::move(intact.error()));
  py::dict out;
  out["tracker"] = as_dict(tracker);
  out["axes"] = as_dict(axes);
  out["environment"] = as_dict(environment);
  out["touches"] = as_dict(touches);
  return out;
}

py::list losses(const RecordingReader& reader) {
  py::list out;
  for (const auto& loss : reader.losses()) out.append(loss.what);
  return out;
}

py::dict attachments(const RecordingReader& reader) {
  py::dict out;
  for (const auto& a : reader.attachments()) out[py::str(a.name)] = py::bytes(a.content);
  return out;
}

}  // namespace

void bind_recording(py::module_& module) {
  py::class_<RecordingReader>(module, "Recording")
      .def_static(
          "open",
          [](const std::string& file) {
            return value_or_raise([&file] {
              const py::gil_scoped_release other_threads_may_run;
              return RecordingReader::open(file);
            }());
          },
          py::arg("file"))
      .def_property_readonly("machine", [](const RecordingReader& r) { return r.info().machine; })
      .def_property_readonly("configuration",
                             [](const RecordingReader& r) { return r.info().configuration; })
      .def_property_readonly("versions",
                             [](const RecordingReader& r) {
                               py::dict out;
                               for (const auto& [name, version] : r.info().versions)
                                 out[py::str(name)] = version;
                               return out;
                             })
      .def_property_readonly("speed", [](const RecordingReader& r) { return r.info().speed; })
      .def_property_readonly(
          "utc_offset_ns",
          [](const RecordingReader& r) { return r.info().utc_offset.value.count(); })
      .def_property_readonly("closed_cleanly", &RecordingReader::closed_cleanly)
      .def_property_readonly("damage", &RecordingReader::damage)
      .def_property_readonly("losses", losses)
      .def_property_readonly("message_count", &RecordingReader::message_count)
      .def_property_readonly("attachments", attachments)
      .def("sha256", &RecordingReader::sha256, py::call_guard<py::gil_scoped_release>())
      .def("streams", streams);
}

}  // namespace abbe::python
