# ParaPoint Bench on the processor: no CUDA.
#     docker build -t parapoint .
#     docker run --rm -v "$PWD/results:/work/results" parapoint benchmarks run smoke --out results/smoke
FROM python:3.12-slim
# libGL for MeshLab; LaTeX and Chromium are for the tests alone and are left out.
RUN apt-get update && apt-get install -y --no-install-recommends libgl1 && rm -rf /var/lib/apt/lists/*
WORKDIR /work
COPY . .
RUN pip install --no-cache-dir torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu \
    && pip install --no-cache-dir -c constraints.txt -e ".[bench,learned,meshlab]"
ENTRYPOINT ["python", "-m"]
CMD ["parapoint", "--help"]
