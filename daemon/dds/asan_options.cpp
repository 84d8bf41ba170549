// Fast DDS 2.9.1 deletes the data of its StatisticsWriterImpl through a base type of another size
// whenever a writer is deleted. The defect is in Fast DDS, and only the size is wrong, so ASan does
// not check it. Linked into programs with Fast DDS when ASan is on.
extern "C" const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "new_delete_type_mismatch=0";
}
