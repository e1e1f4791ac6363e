// The floor of the bench `grid`: a breadth-first search over one array with a bound of walls, and one queue.
//
//   argv    file of the grid (columns, rows: 32 bits each; a byte for each cell, 1 for a path), start cell, waves
//   stdout  sum of all distances, then the time of each wave in ns: a line each

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <vector>

static const int32_t WALL = -2, OPEN = -1;

static void spread(const std::vector<uint8_t> &path, uint32_t stride, uint32_t start, std::vector<int32_t> &labels,
                   std::vector<uint32_t> &queue) {
    for (size_t at = 0; at < labels.size(); at++)
        labels[at] = path[at] ? OPEN : WALL;
    const uint32_t beside[4] = {uint32_t(-stride), 1, stride, uint32_t(-1)};
    size_t head = 0, tail = 0;
    labels[start] = 0;
    queue[tail++] = start;
    while (head < tail) {
        const uint32_t at = queue[head++];
        const int32_t distance = labels[at] + 1;
        for (uint32_t step : beside) {
            const uint32_t next = at + step;
            if (labels[next] == OPEN) {
                labels[next] = distance;
                queue[tail++] = next;
            }
        }
    }
}

int main(int argc, char **argv) {
    if (argc != 4)
        return 2;
    std::ifstream file(argv[1], std::ios::binary);
    uint32_t size[2] = {};
    file.read(reinterpret_cast<char *>(size), sizeof size);
    const uint32_t columns = size[0], rows = size[1], stride = columns + 1;
    std::vector<uint8_t> path(size_t(stride) * (rows + 2) + 1);
    for (uint32_t row = 0; row < rows; row++)
        file.read(reinterpret_cast<char *>(&path[size_t(row + 1) * stride]), columns);
    if (!file)
        return 3;
    const uint32_t cell = uint32_t(atol(argv[2])), start = (cell / columns + 1) * stride + cell % columns;
    std::vector<int32_t> labels(path.size());
    std::vector<uint32_t> queue(size_t(columns) * rows);
    std::vector<long long> times;
    for (long wave = 0; wave < atol(argv[3]); wave++) {
        const auto begin = std::chrono::steady_clock::now();
        spread(path, stride, start, labels, queue);
        const auto end = std::chrono::steady_clock::now();
        times.push_back(std::chrono::duration_cast<std::chrono::nanoseconds>(end - begin).count());
    }
    unsigned long long sum = 0;
    for (int32_t label : labels)
        sum += label > 0 ? label : 0;
    std::printf("%llu\n", sum);
    for (long long ns : times)
        std::printf("%lld\n", ns);
    return 0;
}
